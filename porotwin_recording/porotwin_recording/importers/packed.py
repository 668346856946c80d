"""Data of other programs in archives: zip, tar and gzip, also one within another."""

import gzip
import shutil
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from porotwin_core.basis.declared_size import LARGEST_BYTES, check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular, regular

ZARR_MARKS = ('zarr.json', '.zgroup', '.zmetadata')
"""Files that make a folder a zarr group."""


@contextmanager
def opened_archive(path: Path) -> Iterator[Path]:
    """Yield the file or folder in an archive, in a folder that is removed; else `path` itself.

    Raises:
        InputError: the archive cannot be read, or is too large; also for errors of the block, which
            then name the archive.
    """
    if not _is_packed(path):
        yield path
        return
    with tempfile.TemporaryDirectory() as place:
        try:
            yield _content(path, Path(place))
        except InputError as error:
            raise InputError(str(error).replace(place, str(path))) from None


def _is_packed(path: Path) -> bool:
    """Return whether a file is an archive; npz and newer MATLAB files are none, by their ending."""
    name = path.name.lower()
    return path.is_file() and name.endswith(('.zip', '.tar', '.tgz', '.tar.gz', '.gz'))


def _content(path: Path, place: Path) -> Path:
    """Return what the archive `path` holds, unpacked below `place`: a file or a folder.

    An archive within it is unpacked too, but none within that one: some hold themselves for ever.
    """
    found = _inner(path, place / 'outer')
    return _inner(found, place / 'inner') if _is_packed(found) else found


def _inner(path: Path, folder: Path) -> Path:
    """Unpack `path` into the new `folder`; return its only file, or the folder of its files."""
    folder.mkdir()
    _unpack(path, folder)
    while folder.is_dir():
        if any((folder / mark).exists() for mark in ZARR_MARKS):
            return folder if folder.suffix == '.zarr' else folder.rename(f'{folder}.zarr')
        inside = [one for one in folder.iterdir() if not one.name.startswith(('.', '__MACOSX'))]
        if len(inside) != 1:
            break
        folder = inside[0]
    return folder


def _unpack(path: Path, folder: Path) -> None:
    """Write the files of one archive into `folder`.

    Raises:
        InputError: it is damaged or too large.
    """
    try:
        if tarfile.is_tarfile(regular(path)):  # first: a npz at its end makes it look like a zip
            with tarfile.open(path) as archive:
                check_declared(path, (sum(one.size for one in archive.getmembers()),))
                archive.extractall(folder, filter='data')
        elif zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as archive:
                check_declared(path, (sum(one.file_size for one in archive.infolist()),))
                archive.extractall(folder)
        else:
            with gzip.open(open_regular(path)) as packed, (folder / path.stem).open('wb') as file:
                written = file.write(packed.read(LARGEST_BYTES))
                check_declared(path, (written + len(packed.read(1)),))
    except (InputError, MemoryError):
        raise
    except Exception as e:  # damaged bytes make the libraries raise errors of many types
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f'{path}: not readable as an archive ({e}); copy it again') from None
