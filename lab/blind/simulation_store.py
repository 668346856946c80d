"""All simulations of a diagnosis on disk, so that it runs again without simulating."""

import zlib
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any, BinaryIO, ClassVar

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.kept_simulations import KeptSimulations

LEVELS_PER_UNIT = 60_000.0
"""Levels of the stored maps per unit of concentration: far finer than the noise of any camera."""

HEADER = np.dtype('<i4')
"""Type of the three numbers before the maps: their shape."""


class InTurn(Crew):
    """Does every task at once, in the thread that submits it."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of `function(*args, **kwargs)`, which is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except InputError as error:
            future.set_exception(error)
        return future

    def threads(self, _count: int) -> Executor:
        """Return this crew."""
        return self


class SimulationStore(KeptSimulations):
    """A crew of one thread that keeps every simulation in a folder.

    Stored and new maps are rounded alike, so that a search from the store takes the same path.
    """

    suffix: ClassVar = '.z'
    kept_from_s: ClassVar = 0.0

    def __init__(self, folder: Path) -> None:
        """Keep the simulations in `folder`, which is made."""
        folder.mkdir(parents=True, exist_ok=True)
        super().__init__(InTurn(), folder)

    def read(self, path: Path) -> FloatArray:
        """Return the maps (nt, nz, nx) in the file `path`."""
        return maps_of(path.read_bytes())

    def write(self, file: BinaryIO, maps: FloatArray) -> FloatArray:
        """Write `maps` (nt, nz, nx) from 0 to 1.09 to `file`, and return them rounded."""
        levels = np.rint(np.clip(maps, 0.0, 1.09) * LEVELS_PER_UNIT).astype('<u2')
        content = zlib.compress(np.array(levels.shape, HEADER).tobytes() + levels.tobytes(), 1)
        file.write(content)
        return maps_of(content)


def maps_of(content: bytes) -> FloatArray:
    """Return the maps (nt, nz, nx) that a file with `content` holds."""
    content = zlib.decompress(content)
    begin = 3 * HEADER.itemsize
    shape = np.frombuffer(content[:begin], HEADER)
    levels = np.frombuffer(content[begin:], '<u2').reshape(shape)
    return levels.astype(np.float32) / np.float32(LEVELS_PER_UNIT)
