"""Places on disk: the checkout, its sample rig, and a folder for each run."""

import datetime
from pathlib import Path

from porotwin_core.errors import InputError

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
    folder = output
    if folder is None:
        now = datetime.datetime.now().astimezone()
        folder = Path('runs') / f'{command}-{now:%Y%m%d-%H%M%S}'
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f'{folder} exists already; name another --output or remove it')
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'{folder}: {error.strerror}; name another --output') from None
    return folder.resolve()


def continued_folder(output: Path | None, command: str, results: str) -> Path:
    """Return `output` if it holds files of the pattern `results`, else a new `run_folder`.

    Raises:
        InputError: `output` holds something else.
    """
    if output is not None and any(output.glob(results)):
        return output
    return run_folder(output, command)
