"""Work on many photographs by the workers of a crew: in order, and few in memory at a time."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew, in_order
from porotwin_recording.tables.photos import Photo

Known = TypeVar('Known')
Found = TypeVar('Found')


def each_photo(
    pool: Crew,
    work: Callable[[bytes, Known], Found],
    photos: Sequence[Photo],
    known: Known,
    note: Callable[[Photo, bytes], None] = lambda *_: None,
) -> Iterator[tuple[Photo, Found | InputError]]:
    """Yield every photograph with `work(bytes of the file, known)`, or why there is no result.

    Args:
        pool: the workers.
        work: a function of a module, which a worker elsewhere can import.
        photos: the photographs.
        known: a value for all photographs; every worker gets it once.
        note: called with every photograph and the bytes of its file, when it is read.
    """

    def content(photo: Photo) -> bytes | InputError:
        found = _read_or_reason(photo)
        if isinstance(found, bytes):
            note(photo, found)
        return found

    shared = (work, pool.share(known))
    results = in_order(pool, _done_or_reason, map(content, photos), first=shared)
    yield from zip(photos, results, strict=True)


def read_photo(photo: Photo) -> bytes:
    """Return the bytes of a photograph.

    Raises:
        InputError: its file cannot be read.
    """
    try:
        return photo.read()
    except OSError as error:
        raise InputError(f'cannot be read ({error.strerror})') from None


def _read_or_reason(photo: Photo) -> bytes | InputError:
    try:
        return read_photo(photo)
    except InputError as error:
        return error


def _done_or_reason(
    work: Callable[[bytes, Any], Found], known: Any, content: bytes | InputError
) -> Found | InputError:
    if isinstance(content, InputError):
        return content
    try:
        return work(content, known)
    except InputError as error:
        return error
