"""The commands: a module of this folder is a command of the same name.

`blind_check` is `./porotwin blind-check`; `import_` is `./porotwin import`, because a module cannot
be called import. A module defines

- `command`, a typer function whose docstring is the help text and ends with an example, or a
  `typer.Typer` with a function for each part of the command;
- optionally `CONTEXT_SETTINGS`, options of click for this command.

A package beside this one adds a command by an entry point of the group `porotwin_cli.commands`: its
name is that of the command, its value the module (examples/extension).

Modules are imported for every call, even for `--help`. So they import ROS, torch, scipy and other
large packages inside functions or in helper modules.
"""
