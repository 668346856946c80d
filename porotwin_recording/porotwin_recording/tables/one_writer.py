"""An output that takes long has one writer: a second call for it is refused."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

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
    path = place.with_name(f'.{place.name}.writer')
    lock = FileLock(path)
    with writing(target):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            path.touch()  # the lock tells a place without files, such as /proc, so too
            raise InputError(
                f'{target}: is being written by another call; wait for its end, or name another'
            ) from None
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # before the release, so that nobody holds the old file
        lock.release()


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
