"""An output that takes long has one writer: a second call for it is refused."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from porotwin_core.errors import InputError, write_error


@contextmanager
def one_writer(target: Path) -> Iterator[None]:
    """Keep others from writing `target`, a file or folder that does not exist; make its folder.

    Raises:
        InputError: `target` exists, may not be written, or is being written by another call.
        OSError: the disk is full or fails.
    """
    _check_absent(target)
    lock = target.with_name(f'.{target.name}.writer')
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        file = lock.open('w')
    except OSError as error:
        raise write_error(target, error) from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f'{target}: is being written by another call; wait for its end, or name another'
            ) from None
        try:
            _check_absent(target)  # the other call may have ended just now
            yield
        finally:
            lock.unlink(missing_ok=True)


def _check_absent(target: Path) -> None:
    if target.exists():
        raise InputError(f'{target}: exists already; name another or remove it')
