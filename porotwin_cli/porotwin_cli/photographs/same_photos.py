"""Photographs that are the same file as the one before: the camera hung, or files were copied."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import NAMED
from porotwin_recording.tables.photos import Photo


@dataclass(frozen=True)
class SameFiles:
    """Photographs in a row whose files are equal byte for byte.

    Attributes:
        first: name of the first one.
        last: name of the last one.
        count: how many there are, with the first one.
    """

    first: str
    last: str
    count: int

    def __str__(self) -> str:
        """One line for the operator."""
        return (
            f'{self.first} to {self.last}: {self.count} photographs in a row are the same file, '
            'byte for byte: the camera may have hung, or files were copied; leave copies out of '
            'imaging.csv'
        )

    @property
    def entry(self) -> dict[str, Any]:
        """The entry in an answer for programs."""
        return {'first': self.first, 'last': self.last, 'photographs': self.count}


@dataclass
class PhotoDigests:
    """Keeps a digest of every photograph that was read."""

    _known: dict[Photo, bytes] = field(default_factory=dict, init=False)

    def note(self, photo: Photo, content: bytes) -> None:
        """Keep the digest of the file of a `photo`."""
        self._known[photo] = hashlib.sha256(content).digest()

    def same_files(self, photos: Sequence[Photo]) -> list[SameFiles]:
        """Return the runs of equal files among `photos`, in their order.

        A photograph that was not noted yet is read now. One that cannot be read equals no other.
        """
        runs = (list(run) for _, run in groupby(photos, self._digest))
        return [SameFiles(run[0].name, run[-1].name, len(run)) for run in runs if len(run) > 1]

    def _digest(self, photo: Photo) -> object:
        if photo not in self._known:
            try:
                self.note(photo, photo.read())
            except (InputError, OSError):
                return object()
        return self._known[photo]


def told(runs: Sequence[SameFiles]) -> Iterator[str]:
    """Yield the lines about equal photographs: the first runs, and how many there are more."""
    yield from map(str, runs[:NAMED])
    if len(runs) > NAMED:
        count = sum(run.count for run in runs[NAMED:])
        yield f'{len(runs) - NAMED} more such rows with {count} equal photographs'
