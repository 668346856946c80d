"""Places on disk: the checkout, its sample rig, and a folder for each run."""

import datetime
import itertools
from contextlib import suppress
from pathlib import Path

from porotwin_core.basis.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
"""The checkout. For an installed package it has no meaning; such a package has no tests either."""


def small_rig() -> Path:
    """Return the path of the paper's small rig, in the checkout or in an installed share folder."""
    beside = ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml'
    if beside.is_file():
        return beside
    from ament_index_python.packages import get_package_share_directory

    return Path(get_package_share_directory('porotwin_hub'), 'config', 'small_rig.yaml')


def run_folder(output: Path | None, command: str) -> Path:
    """Make and return a folder for a run: `output`, or runs/COMMAND-DATE-TIME.

    Raises:
        InputError: `output` exists and is not empty, or cannot be made.
    """
    if output is None:
        return _new_run(command)
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise InputError(f'{output} exists already; name another --output or remove it')
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _cannot_be_made(output, error) from None
    return output.resolve()


def _new_run(command: str) -> Path:
    """Make and return the folder of a run that has no name; two of the same second get two."""
    now = datetime.datetime.now().astimezone()
    first = Path('runs') / f'{command}-{now:%Y%m%d-%H%M%S}'
    try:
        first.parent.mkdir(exist_ok=True)
        for number in itertools.count(1):
            folder = first if number == 1 else first.with_name(f'{first.name}-{number}')
            with suppress(FileExistsError):
                folder.mkdir()
                return folder.resolve()
    except OSError as error:
        raise _cannot_be_made(first, error) from None
    raise AssertionError('numbers have no end')


def _cannot_be_made(folder: Path, error: OSError) -> InputError:
    return InputError(f'{folder}: {error.strerror}; name another --output')
