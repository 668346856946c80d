"""An output that takes long has one writer: a second call for it is refused."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from porotwin_core.basis.errors import InputError, writing


@contextmanager
def only_writer(target: Path) -> Iterator[None]:
    """Keep others from writing the file or folder `target`, which may exist; make its folder.

    The system releases the lock with the process, so that a kill leaves none.

    Raises:
        InputError: `target` may not be written, or is being written by another call.
        OSError: the disk is full or fails.
    """
    place = target.resolve()
    if not place.name:
        raise InputError(f'{target}: is the root of all folders; name a folder for this output')
    lock = place.with_name(f'.{place.name}.writer')
    with writing(target):
        lock.parent.mkdir(parents=True, exist_ok=True)
        file = _locked(lock)
    if file is None:
        raise InputError(
            f'{target}: is being written by another call; wait for its end, or name another'
        )
    with file:
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def _locked(lock: Path) -> TextIO | None:
    """Return the open file `lock` with its lock; None if another call holds it."""
    while True:
        file = lock.open('w')
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            return None
        if lock.exists() and os.path.samestat(lock.stat(), os.fstat(file.fileno())):
            return file
        file.close()  # the other call has just ended, and has removed the file


@contextmanager
def one_writer(target: Path) -> Iterator[None]:
    """Keep others from writing `target`, a file or folder that does not exist; make its folder.

    Raises:
        InputError: `target` exists, may not be written, or is being written by another call.
        OSError: the disk is full or fails.
    """
    _check_absent(target)
    with only_writer(target):
        _check_absent(target)  # the other call may have ended just now
        yield


def _check_absent(target: Path) -> None:
    if target.exists():
        raise InputError(f'{target}: exists already; name another or remove it')
