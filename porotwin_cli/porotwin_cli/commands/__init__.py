"""The commands: a module of this folder is a command of the same name.

`blind_check` is `./porotwin blind-check`; `import_` is `./porotwin import`, because a module cannot
be called import. A module defines

- `command`, a typer function whose docstring is the help text and ends with an example, or a
  `typer.Typer` with a function for each part of the command;
- optionally `CONTEXT_SETTINGS`, options of click for this command.

Modules are imported for every call, even for `--help`. So they import ROS, torch, scipy and other
large packages inside functions or in helper modules.
"""
