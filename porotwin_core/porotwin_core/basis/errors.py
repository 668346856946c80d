"""Errors for users: wrong input, and files that cannot be written."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FULL_BYTES = 1_000_000
"""Free space below which a disk counts as full [B]: libraries give no reason for failed writes."""

MAY_NOT = (
    errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR, errno.EISDIR,
    errno.EEXIST, errno.ENAMETOOLONG, errno.ELOOP,
)  # fmt: skip
"""Faults of writing that another path mends; a folder below a file exists already, as a file."""


class InputError(ValueError):
    """A file, value, name or message given to the twin is wrong.

    The message is one line with the thing, its value and the remedy. Commands print the message
    and exit with status 2. Nodes log the message and continue.
    """


def write_error(path: Path, error: Exception) -> Exception:
    """Return the error to raise because the output `path` cannot be written.

    Args:
        path: the output that the user named.
        error: from the operating system, or from a library, which may not give the reason.

    Returns:
        An InputError if another path helps; an OSError if the disk is full or fails.
    """
    number = error.errno if isinstance(error, OSError) else None
    if number in MAY_NOT and not (number == errno.EACCES and _is_full(path)):  # as netCDF says it
        return InputError(
            f'{path}: cannot be written ({os.strerror(number or 0)}); name an output where you may '
            'write'
        )
    reason = os.strerror(number) if number and number > 0 else str(error)
    if number in (errno.ENOSPC, errno.EDQUOT) or _is_full(path):
        return OSError(f'{path}: no space left on its disk; remove something or name another')
    return OSError(f'{path}: cannot be written ({reason}); look at its disk, or name another')


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Let a fault of the block, which writes the output `path`, be told by `write_error`.

    Raises:
        InputError: the output may not be written there.
        OSError: the disk is full or fails.
    """
    try:
        yield
    except OSError as error:
        raise write_error(path, error) from None


def refuse_file(folder: Path, purpose: str) -> None:
    """Check that `folder` is a folder or new; the `purpose` names its content.

    Raises:
        InputError: it is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f'{folder}: is a file; name a folder for {purpose}')


def check_writable(path: Path) -> None:
    """Check that the file or new folder `path` may be written, with the folders it needs.

    Raises:
        InputError: its nearest existing folder, or the file itself, may not be written.
    """
    with writing(path):  # a folder may not let one look into it
        above = next(place for place in path.absolute().parents if place.exists())
        existing = (above, path) if path.exists() else (above,)
    if not above.is_dir():
        raise write_error(path, NotADirectoryError(errno.ENOTDIR, ''))
    for place in existing:
        if not os.access(place, os.W_OK):
            raise write_error(path, PermissionError(errno.EACCES, ''))


def _is_full(path: Path) -> bool:
    try:
        folder = next(one for one in path.absolute().parents if one.is_dir())
        return shutil.disk_usage(folder).free < FULL_BYTES
    except OSError:
        return False
