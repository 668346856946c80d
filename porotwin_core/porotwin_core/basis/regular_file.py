"""Files that a person names: every reader opens them here, or asks here before a library does.

A FIFO or a socket would keep its reader for ever, and a device has no end.
"""

import errno
import io
import os
import stat
from pathlib import Path
from typing import BinaryIO, TextIO

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError


def regular(path: Path) -> Path:
    """Return `path`, for a library that opens a file by its name.

    Raises:
        InputError: it is a FIFO, a socket or a device.
        OSError: it is a folder, or there is nothing to open.
    """
    _check(path, path.stat().st_mode)
    return path


def open_regular(path: Path, *, links: bool = True) -> BinaryIO:
    """Open the file `path` for reading, without waiting; `links` tells whether it may be one.

    Raises:
        InputError: it is a FIFO, a socket or a device.
        OSError: it is a folder, or cannot be opened.
    """
    regular(path)
    # something else may have taken its place since
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | (0 if links else os.O_NOFOLLOW)
    file = os.fdopen(os.open(path, flags), 'rb')
    try:
        _check(path, os.fstat(file.fileno()).st_mode)
    except BaseException:
        file.close()
        raise
    return file


def open_text(path: Path, encoding: str, errors: str = 'strict') -> TextIO:
    """Open the text file `path` as `open_regular` does; ends of lines stay, as for csv.reader."""
    return io.TextIOWrapper(open_regular(path), encoding, errors, newline='')


def read_regular(path: Path, first: int | None = None) -> bytes:
    """Return the `first` bytes of the file `path`; None: all of them.

    Raises:
        InputError: it is a FIFO, a socket or a device, or too large to read at once.
        OSError: it is a folder, or cannot be read.
    """
    with open_regular(path) as file:
        if first is not None:
            return file.read(first)
        check_declared(path, (os.fstat(file.fileno()).st_size,))
        return file.read()


def _check(path: Path, mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise InputError(f'{path}: is a FIFO, socket or device; name a file')
