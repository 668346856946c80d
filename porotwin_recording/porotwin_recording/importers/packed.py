"""Data of other programs in archives: zip, tar, gzip, bzip2 and xz, also one within another.

The first bytes tell its kind: people rename files.
"""

import bz2
import gzip
import lzma
import re
import shutil
import tarfile
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from porotwin_core.basis.declared_size import LARGEST_BYTES, check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular, read_regular, regular
from porotwin_recording.mcap.bag_folder import is_bag

ZARR_MARKS = ('zarr.json', '.zgroup', '.zmetadata')
"""Files that make a folder a zarr group."""

ZIP = b'PK\x03\x04'
PACKERS: dict[bytes, Callable[[BinaryIO], Any]] = {
    b'\x1f\x8b': gzip.open,
    b'BZh': bz2.open,
    b'\xfd7zXZ': lzma.open,
}
"""First bytes of a file that was packed alone, and its reader."""
PACKED_ENDINGS = ('.gz', '.bz2', '.xz')
"""Endings that such a file adds to its own name."""
READ_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)

UNREAD = {
    b"7z\xbc\xaf'\x1c": 'a 7z archive, which is not read; unpack it with 7z x',
    b'Rar!': 'a rar archive, which is not read; unpack it with unrar x',
    b'\x28\xb5\x2f\xfd': 'packed by zstd, which is not read; unpack it with unzstd',
    b'\x04"M\x18': 'packed by lz4, which is not read; unpack it with unlz4',
    b'\x1f\x9d': 'packed by compress, which is not read; unpack it with uncompress',
    b'PK\x05\x06': 'an archive without a file; pack the data again',
    b'MSCF': 'a cabinet, which is not read; unpack it with cabextract',
    b'PK\x07\x08': 'a part of a zip in parts, which is not read; unpack all parts with 7z x',
    b'\xd0\xcf\x11\xe0': 'an old spreadsheet or document; save its table as CSV',
    b'PAR1': 'a parquet table, which is not read; write it as CSV',
    b'\x93NUMPY': 'one array without times; write maps and time_s with numpy.savez',
    b'version https://git-lfs': 'a pointer of Git LFS; fetch the file with git lfs pull',
    b'<!DOCTYPE html': 'a web page; download the file itself',
    b'<!doctype html': 'a web page; download the file itself',
    b'<html': 'a web page; download the file itself',
}
"""First bytes of files that are not read, their kind, and the remedy."""


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
            unpacked = rf'{re.escape(place)}(/outer|/inner)?'
            raise InputError(re.sub(unpacked, lambda _: str(path), str(error))) from None


def _is_packed(path: Path) -> bool:
    """Return whether a file is an archive that is read, whatever its ending.

    Raises:
        InputError: it is one that is not read, or nothing that holds data.
    """
    if not path.is_file() or is_bag(path):
        return False
    begin = read_regular(path, tarfile.BLOCKSIZE)
    for sign, words in UNREAD.items():
        if begin.startswith(sign):
            raise InputError(f'{path}: is {words}')
    if not begin:
        raise InputError(f'{path}: is empty; copy it again')
    is_tar = path.suffix.lower() == '.tar' or b'ustar' in begin
    is_zip = begin.startswith(ZIP) and path.suffix.lower() != '.npz'
    return is_tar or is_zip or begin.startswith(tuple(PACKERS))


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
        elif packer := _packer(path):
            ending = path.suffix.lower() in PACKED_ENDINGS
            target = folder / (path.stem if ending else path.name)
            with packer(open_regular(path)) as packed, target.open('wb') as file:
                written = file.write(packed.read(LARGEST_BYTES))
                check_declared(path, (written + len(packed.read(1)),))
        else:
            with zipfile.ZipFile(path) as archive:
                _refuse(path, archive.infolist())
                archive.extractall(folder)
    except (InputError, MemoryError):
        raise
    except Exception as e:  # damaged bytes make the libraries raise errors of many types
        shutil.rmtree(folder, ignore_errors=True)
        raise InputError(f'{path}: not readable as an archive ({e}); copy it again') from None


def _packer(path: Path) -> Callable[[BinaryIO], Any] | None:
    """Return the reader of a file that was packed alone; None for others."""
    begin = read_regular(path, len(ZIP) + 2)
    return next((opened for sign, opened in PACKERS.items() if begin.startswith(sign)), None)


def _refuse(path: Path, members: Sequence[zipfile.ZipInfo]) -> None:
    """Raise InputError for a zip that is a spreadsheet, too large, encrypted or packed rarely."""
    if any(one.filename == '[Content_Types].xml' for one in members):
        raise InputError(f'{path}: is a spreadsheet or document; save its table as CSV')
    check_declared(path, (sum(one.file_size for one in members),))
    if any(one.flag_bits & 1 for one in members):
        raise InputError(f'{path}: is encrypted; unpack it with its password')
    if any(one.compress_type not in READ_METHODS for one in members):
        raise InputError(f'{path}: is packed in a way that is not read; unpack it with 7z x')
