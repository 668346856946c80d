"""All simulations of a diagnosis on disk, so that it runs again without simulating."""

import zlib
from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.kept_simulations import key_of

LEVELS_PER_UNIT = 60_000.0
"""Levels of the stored maps per unit of concentration: far finer than the noise of any camera."""

HEADER = np.dtype('<i4')
"""Type of the three numbers before the maps: their shape."""


class InTurn(Executor):
    """Does every task at once, in the thread that submits it."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of `function(*args, **kwargs)`, which is done."""
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except InputError as error:
            future.set_exception(error)
        return future


class SimulationStore(InTurn, Crew):
    """A crew of one thread that keeps every simulation in a folder.

    Stored and new maps are rounded alike, so that a search from the store takes the same path.

    Attributes:
        found: simulations that were read.
        made: simulations that were made.
    """

    def __init__(self, folder: Path) -> None:
        """Keep the simulations in `folder`, which is made."""
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self.found = self.made = 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of the simulation `function(*args, **kwargs)`: maps (nt, nz, nx)."""
        call = partial(function, *args, **kwargs)
        return super().submit(self._maps, self._folder / f'{key_of(call)}.z', call)

    def threads(self, _count: int) -> Executor:
        """Return an executor that does tasks in turn."""
        return InTurn()

    def _maps(self, path: Path, call: Callable[[], FloatArray]) -> FloatArray:
        if path.exists():
            self.found += 1
            return read_maps(path)
        self.made += 1
        write_maps(path, call())
        return read_maps(path)


def write_maps(path: Path, maps: FloatArray) -> None:
    """Write `maps` (nt, nz, nx) from 0 to 1.09 in whole levels, either completely or not at all."""
    levels = np.rint(np.clip(maps, 0.0, 1.09) * LEVELS_PER_UNIT).astype('<u2')
    begun = path.with_name(uuid4().hex)
    content = np.array(levels.shape, HEADER).tobytes() + levels.tobytes()
    begun.write_bytes(zlib.compress(content, 1))
    begun.replace(path)


def read_maps(path: Path) -> FloatArray:
    """Return the maps (nt, nz, nx) in the file `path`."""
    content = zlib.decompress(path.read_bytes())
    begin = 3 * HEADER.itemsize
    shape = np.frombuffer(content[:begin], HEADER)
    levels = np.frombuffer(content[begin:], '<u2').reshape(shape)
    return levels.astype(np.float32) / np.float32(LEVELS_PER_UNIT)
