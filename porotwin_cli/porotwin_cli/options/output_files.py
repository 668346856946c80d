"""Output files: checked before the work begins, and tables as CSV."""

import csv
import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from porotwin_core import PROGRAM
from porotwin_core.basis.errors import InputError, check_writable, writing
from porotwin_core.basis.netcdf_file import open_netcdf
from porotwin_core.rig.rig_file import names_file, rig_file

_Arguments = ParamSpec('_Arguments')
_Result = TypeVar('_Result')


def maker(command: str) -> str:
    """Return the words that name the command which made a file."""
    return f'{PROGRAM}, {command}'


def one_call_for_each_output(
    command: Callable[_Arguments, _Result],
) -> Callable[_Arguments, _Result]:
    """Refuse a call of `command` while another call writes the file that its `output` names.

    Without this, two calls would mix their maps, tables and pictures.

    Raises:
        InputError: the output is a folder.
    """

    @functools.wraps(command)
    def guarded(*args: _Arguments.args, **kwargs: _Arguments.kwargs) -> _Result:
        from porotwin_recording.tables.one_writer import only_writer

        output = inspect.signature(command).bind(*args, **kwargs).arguments['output']
        _refuse_folder(output)
        if not output.parent.is_dir():  # the command says so
            return command(*args, **kwargs)
        with only_writer(output):
            return command(*args, **kwargs)

    return guarded


@contextmanager
def maps_are_kept(output: Path) -> Iterator[None]:
    """Let a fault of the block, which writes more, tell that the maps are in `output`.

    Raises:
        OSError: the disk is full or fails.
    """
    try:
        yield
    except OSError as error:
        raise OSError(f'{error.strerror or error}; the maps are complete in {output}') from None


def check_output(output: Path, *inputs: Path | None, command: str = '', named: bool = True) -> None:
    """Check that a command can write the file `output` without harm to other files.

    Args:
        output: the file to write.
        inputs: files and folders that the command reads; None: not given. No existing file inside
            an input folder may be replaced, except one that the same command made; no file that a
            description among them names.
        command: the command, as given to `maker`; empty: its files do not name it.
        named: whether the user named `output`. A file that nobody named replaces only one that the
            same command made.

    Raises:
        InputError: `output` is an input, would replace a file of one, or one of another program
            that nobody named, is a folder, or lies in a folder that does not exist or may not be
            written.
    """
    _refuse_folder(output)
    if not output.parent.is_dir():
        raise InputError(f'{output}: there is no folder {output.parent}; make it, or name another')
    check_writable(output)
    if not output.exists():
        if output.is_symlink():
            raise InputError(f'{output}: is a link to nothing; name another output or remove it')
        return
    for path in inputs:
        if path is None or not path.exists():
            continue
        if path.samefile(output):
            raise InputError(f'{output}: is an input of this command; name another output')
        inside = path.is_dir() and _inside(output, path) and not _made(output, command)
        if inside or names_file(rig_file(path), output):
            raise InputError(
                f'{output}: is a file of the input {path}; name another output or remove it'
            )
    if not named and not _made(output, command):
        raise InputError(
            f'{output}: exists already, and {command} did not make it; give another --output, or '
            'rename it'
        )


def _refuse_folder(output: Path) -> None:
    if output.is_dir():
        raise InputError(f'{output}: is a folder; name a file in it')


def _made(file: Path, command: str) -> bool:
    """Return whether `command` made this NetCDF file or picture, and no command reads it.

    The files of an experiment folder, `FILES`, are always kept.
    """
    from PIL import Image

    from porotwin_recording.experiment.experiment_folder import FILES

    if not command or {file.name, file.resolve().name} & {*FILES}:
        return False
    if file.suffix == '.csv':  # it belongs to the maps beside it
        return _made(file.with_suffix('.nc'), command)
    try:
        if file.suffix == '.nc':
            with open_netcdf(file) as dataset:
                words = str(getattr(dataset, 'program', ''))
        else:
            with Image.open(file) as picture:
                words = str(picture.info.get('Software', ''))
    except (InputError, OSError):
        return False
    name, made = PROGRAM.split()[0], words.rpartition(', ')[2]
    return words.startswith(f'{name} ') and made == command


def _inside(file: Path, folder: Path) -> bool:
    """Return whether `file`, or the file that it links to, lies in `folder`."""
    real = folder.resolve()
    named = file.parent.resolve() / file.name
    return named.is_relative_to(real) or file.resolve().is_relative_to(real)


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the rows of a table, at least one, as CSV.

    Raises:
        InputError: the file may not be written there.
        OSError: the disk is full or fails.
    """
    with writing(path), path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
