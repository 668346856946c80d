"""The command line: the commands it has, and how each of them ends."""

import errno
import importlib
import importlib.util
import pkgutil
import sys
import typing
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from unicodedata import category

import typer

from porotwin_cli import commands
from porotwin_cli.terminal import WorkFailed, say, show_warnings
from porotwin_core.basis.discovery import installed, loaded
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.plain_text import plain, show_all_characters

FULL = (errno.ENOSPC, errno.EDQUOT)
DISK_FULL = 'no space left on a disk that this command writes to; remove something there'

HELP_OPTIONS = ('-h', '--help')

GUIDE = 'commands/__init__.py'

LAB = 'lab'
"""The laboratory of a checkout, with the commands bench, blind-check and experiment."""


def command_folders() -> Iterator[ModuleType]:
    """Yield the packages whose modules are commands; an installed program has no laboratory."""
    yield commands
    if importlib.util.find_spec(LAB) is not None:
        yield importlib.import_module(f'{LAB}.commands')


def own_modules() -> dict[str, ModuleType]:
    """Return the modules of our own commands, by the name of the command."""
    return {
        module.name.strip('_').replace('_', '-'): importlib.import_module(
            f'{folder.__name__}.{module.name}'
        )
        for folder in command_folders()
        for module in pkgutil.iter_modules(folder.__path__)
    }


@cache
def added_modules() -> dict[str, ModuleType]:
    """Return those of other packages; one line tells of each that cannot be had."""
    found = {}
    for one in installed(commands.__name__):
        where = f'{one.value} of {one.group}'
        try:
            if one.name in own_modules():
                raise InputError(f'{where}: there is a {one.name} already; give it another name')
            found[one.name] = typing.cast(ModuleType, loaded(one.value, where, GUIDE))
        except InputError as error:
            say(f'porotwin: {error}')
    return found


def command_modules() -> dict[str, ModuleType]:
    """Return the module of each command by the name of the command, as `commands` explains."""
    return {**added_modules(), **own_modules()}


def make_app() -> typer.Typer:
    """Return the application with all commands."""
    app = typer.Typer(
        help=(
            'PoroTwin: a live digital twin of a FluidFlower rig on ROS 2 Jazzy.\n\n'
            'Exit status: 0 done, 1 the work failed, 2 wrong input, 130 interrupted. '
            'Results go to standard output, messages and progress to standard error.'
        ),
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={'help_option_names': list(HELP_OPTIONS)},
    )
    for name, module in sorted(command_modules().items()):
        command = getattr(module, 'command', None)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        elif callable(command):
            settings = getattr(module, 'CONTEXT_SETTINGS', None)
            app.command(name, context_settings=settings)(command)
        else:
            say(f'porotwin: {module.__file__}: no function `command`; see {GUIDE}')
    return app


app = make_app()


def path_options(command: typer.Typer | Callable[..., object]) -> set[str]:
    """Return the options of a command, and of its parts, that take a path, such as --output."""
    if isinstance(command, typer.Typer):
        parts = (part.callback for part in command.registered_commands)
        return {option for part in parts if part is not None for option in path_options(part)}
    hints = typing.get_type_hints(command)
    return {
        f'--{name.replace("_", "-")}'
        for name, hint in hints.items()
        if Path in (hint, *typing.get_args(hint))
    }


def refuse_empty_paths(arguments: Sequence[str]) -> None:
    """Check that no path on the command line is empty, as with a variable that the shell lacks.

    An empty path would mean the working folder.

    Raises:
        InputError: one is; the line names its option.
    """
    module = command_modules().get(arguments[0]) if arguments else None
    if module is None or not hasattr(module, 'command'):
        return
    paths = path_options(module.command)
    words = [part for word in arguments[1:] for part in _divided(word)]
    for before, word in zip(['', *words], words, strict=False):
        if word == '' and (before in paths or not before.startswith('--')):
            raise InputError(
                f'{before or "an argument"}: is empty; name a file or a folder, or . for this one'
            )


def refuse_unreadable_names(arguments: Sequence[str]) -> None:
    """Check that all arguments are UTF-8, which reports and pictures are written in, on one line.

    Raises:
        InputError: one is not, such as the name of a file from another system.
    """
    for word in arguments:
        shown = word.encode('utf-8', 'backslashreplace').decode()
        if shown != word:
            raise InputError(f'{shown}: this name is not UTF-8; rename the file or folder')
        if any(category(character) == 'Cc' for character in word):
            raise InputError(
                f'{plain(word)}: this name holds a line break or another control character; rename '
                'the file or folder'
            )


INSTALL_ALL = 'install what is missing: pip install ".[all]" in the checkout'


def _divided(word: str) -> list[str]:
    """Return --option=value as two words, and other words as they are."""
    name, equals, value = word.partition('=')
    return [name, value] if equals and name.startswith('--') else [word]


def run() -> None:
    """Run the command; exit with 0 done, 1 the work failed, 2 wrong input.

    Raises:
        KeyboardInterrupt: after Ctrl-C; typer exits with 130 instead.
    """
    show_all_characters()
    show_warnings()
    try:
        refuse_unreadable_names(sys.argv[1:])
        refuse_empty_paths(sys.argv[1:])
        app(prog_name='porotwin')
    except InputError as error:
        print(f'porotwin: {plain(str(error))}', file=sys.stderr)
        sys.exit(2)
    except MemoryError:
        print('porotwin: the memory is full; give less at once, or more memory', file=sys.stderr)
        sys.exit(1)
    except ModuleNotFoundError as error:
        print(f'porotwin: {error}; {INSTALL_ALL}', file=sys.stderr)
        sys.exit(1)
    except (WorkFailed, OSError) as error:  # OSError: full disk, port in use, lost network share
        print(f'porotwin: {plain(_failure_words(error))}', file=sys.stderr)
        sys.exit(1)


def _failure_words(error: WorkFailed | OSError) -> str:
    if not isinstance(error, OSError):
        return str(error)
    if error.errno in FULL:
        return DISK_FULL
    return f'{error.filename}: {error.strerror}' if error.filename else str(error)
