"""Maps of a running experiment in a temporary file, so memory stays bounded.

The file has no name: the system removes it with the process, however it ends.
"""

import os
import tempfile
from pathlib import Path

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray


class MapFile:
    """A list of at most `most` maps of one shape, as float32; a full list drops every second map.

    The first and the newest map stay.
    """

    def __init__(self, shape: tuple[int, int], most: int, folder: Path | None = None) -> None:
        """Keep maps of `shape` (nz, nx) in `folder`, or in the system's folder for such files."""
        self._shape = shape
        self._bytes = 4 * shape[0] * shape[1]
        self._most = most
        self._folder = folder
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  open as long as the object
        self._times: list[float] = []
        self._slots: list[int] = []

    def __len__(self) -> int:
        """Return the number of maps."""
        return len(self._times)

    @property
    def times(self) -> tuple[float, ...]:
        """The times of the maps [s]."""
        return tuple(self._times)

    def append(self, time: float, values: FloatArray) -> None:
        """Add the map `values` (nz, nx) at `time` [s].

        Raises:
            InputError: the disk is full.
        """
        free = set(range(self._most + 1)).difference(self._slots)
        slot = min(free)
        data = np.ascontiguousarray(values, dtype=np.float32).tobytes()
        try:
            written = os.pwrite(self._file.fileno(), data, slot * self._bytes)
        except OSError:
            written = 0
        if written < self._bytes:
            raise InputError(
                f'map at {time:.0f} s not kept for the diagnosis: '
                f'{self._folder or tempfile.gettempdir()} is full; free some space'
            )
        self._times.append(time)
        self._slots.append(slot)
        if len(self._times) > self._most:
            del self._times[1:-1:2], self._slots[1:-1:2]

    def clear(self) -> None:
        """Forget all maps."""
        self._times, self._slots = [], []

    def read(self, start: int, stop: int) -> FloatArray:
        """Return the maps from number `start` to before `stop`, (stop - start, nz, nx)."""
        raw = [
            os.pread(self._file.fileno(), self._bytes, slot * self._bytes)
            for slot in self._slots[start:stop]
        ]
        return np.frombuffer(b''.join(raw), dtype=np.float32).reshape(-1, *self._shape)
