"""A run as one file: its bag or folder, calibration, reports, pictures, logs, and the versions.

The file is a zip. The file with the token of its page stays out: it is a key to the running twin.
"""

import importlib.metadata
import json
import platform
import shutil
import zipfile
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError, writing
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_folder import whole_folder
from porotwin_recording.tables.one_writer import one_writer

VERSIONS_FILE = 'versions.json'
"""File of an archive with the versions of the program and of all its packages."""

SECRETS = ('page_token',)
"""Files of a run that are nobody else's business."""


def files_of(run: Path) -> Iterator[Path]:
    """Yield the files of a run, without links, secrets and files that are being written."""
    if run.is_file():
        yield run
        return
    for path in sorted(run.rglob('*')):
        hidden = any(part.startswith('.') for part in path.relative_to(run).parts)
        if path.is_file() and not (path.is_symlink() or hidden or path.name in SECRETS):
            yield path


def write_archive(run: Path, file: Path, *, beside: Iterable[Path] = ()) -> int:
    """Write the files of a `run` into the zip `file`; return their number.

    Args:
        run: a folder of a run, an experiment folder, or a bag.
        file: the archive, which does not exist.
        beside: more files or folders, such as the calibration or a report from elsewhere.

    Raises:
        InputError: the run holds nothing, or the file exists or cannot be written.
    """
    root = run.parent if run.is_file() else run
    found = [(path, path.relative_to(root)) for path in files_of(run)]
    if not found:
        raise InputError(f'{run}: holds no files; name a folder in runs/, or a recording')
    for one in beside:
        found += [(path, Path('beside') / path.relative_to(one.parent)) for path in files_of(one)]
    with (
        one_writer(file),
        writing(file),
        whole_folder(file, named=True) as unfinished,
        zipfile.ZipFile(unfinished, 'w', zipfile.ZIP_DEFLATED) as archive,
    ):
        for path, name in found:
            archive.write(path, name)
        archive.writestr(VERSIONS_FILE, json.dumps(versions(), indent=1))
    return len(found)


def versions() -> dict[str, object]:
    """Return the versions of the program, of Python, and of all packages by name."""
    packages = {
        one.metadata['Name']: one.version
        for one in importlib.metadata.distributions()
        if one.metadata['Name']
    }
    return {
        'porotwin': __version__,
        'python': platform.python_version(),
        'machine': platform.platform(),
        'written': datetime.now(UTC).isoformat(timespec='seconds'),
        'packages': dict(sorted(packages.items())),
    }


def open_archive(file: Path, folder: Path) -> dict[str, object]:
    """Unpack an archive into the new `folder`; return the versions that wrote it.

    Raises:
        InputError: it is no archive of a run, it is damaged, it does not fit the disk, or the
            folder exists.
    """
    try:
        with one_writer(folder), zipfile.ZipFile(file) as archive:
            if VERSIONS_FILE not in archive.namelist():
                raise InputError(f'{file}: is no archive of a run: it holds no {VERSIONS_FILE}')
            size = sum(entry.file_size for entry in archive.infolist())
            if size > shutil.disk_usage(folder.absolute().parent).free:
                raise InputError(f'{file}: its {size / 1e9:.3g} GB do not fit this disk')
            with whole_folder(folder) as unfinished:
                archive.extractall(unfinished)
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, OSError) as error:
        raise InputError(f'{file}: cannot be unpacked: {error}; copy it again') from None
    try:
        told = json_value(read_regular(folder / VERSIONS_FILE))
    except ValueError:
        told = {}
    return told if isinstance(told, dict) else {}
