"""Simulations on disk, so that an interrupted diagnosis goes on where it stopped.

A search asks for the same simulations in the same order. A second call of the same diagnosis finds
the long ones of the first call in the folder of the report, and reaches the same place in a
fraction of the time. The folder of the simulations goes away with the end of the diagnosis.
"""

import hashlib
import re
import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, ClassVar
from uuid import uuid4

import numpy as np

from porotwin_core.basis.parallel import Crew, versions
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig

FOLDER = 'simulations'
"""Name of their folder, in the folder of the report."""

OWN_NAME = re.compile(r'[0-9a-f]{32}\.(npy|begun)')
"""Names of the files of simulations."""

KEPT_FROM_S = 0.3
"""Duration from which a simulation is kept [s]: a short one is made again as fast as it is read."""

LEAST_FREE_BYTES = 100_000_000
"""Space that stays free for the report and for others [B]; with less, no simulation is kept."""


class KeptSimulations(Crew):
    """A crew that keeps the simulations of another one.

    Attributes:
        found: simulations that were read.
        made: simulations that the other crew made.
        suffix: end of the names of the files.
        kept_from_s: duration from which a simulation is kept [s].
    """

    suffix: ClassVar = '.npy'
    kept_from_s: ClassVar = KEPT_FROM_S

    def __init__(self, crew: Crew, folder: Path) -> None:
        """Keep the simulations of `crew` in `folder`, which the first one makes."""
        self._crew, self._folder = crew, folder
        self.workers = crew.workers
        self.found = self.made = 0

    @property
    def kept(self) -> int:
        """Number of simulations in the folder."""
        return len(list(self._folder.glob(f'*{self.suffix}')))

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return the future of a simulation `function(*args, **kwargs)`, which returns an array."""
        call = partial(function, *args, **kwargs)
        path = self._folder / f'{key_of(call)}{self.suffix}'
        future: Future[Any] = Future()
        try:
            future.set_result(self.read(path))
            self.found += 1
        except (OSError, ValueError, EOFError):  # absent, or cut short with the power
            task = self._crew.submit(_timed, call)
            task.add_done_callback(partial(self._deliver, future, path))
            future.add_done_callback(lambda done: done.cancelled() and task.cancel())
        return future

    def read(self, path: Path) -> FloatArray:
        """Return the maps in `path`; OSError, ValueError or EOFError: there is no whole file."""
        maps: FloatArray = np.load(path)
        return maps

    def write(self, file: BinaryIO, maps: FloatArray) -> FloatArray:
        """Write `maps` to `file`, and return them as they will be read."""
        np.save(file, maps)
        return maps

    def threads(self, count: int) -> Executor:
        """Return `count` threads here for work that waits for tasks of this crew."""
        return self._crew.threads(count)

    def remove(self) -> None:
        """Remove all simulations: the diagnosis has ended. Other files in their folder stay."""
        for path in self._folder.glob('*'):
            if OWN_NAME.fullmatch(path.name):
                path.unlink(missing_ok=True)
        with suppress(OSError):  # absent, or it holds other files
            self._folder.rmdir()

    def _deliver(self, future: Future[Any], path: Path, task: Future[tuple[float, Any]]) -> None:
        """Pass on the end of `task`, and keep what it found, also if nobody waits any more."""
        if task.cancelled():
            future.cancel()
            return
        error, maps = task.exception(), None
        if error is None:
            seconds, maps = task.result()
            self.made += 1
            if seconds >= self.kept_from_s:
                maps = self._keep(path, maps)
        if not future.set_running_or_notify_cancel():
            return
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(maps)

    def _keep(self, path: Path, maps: FloatArray) -> FloatArray:
        """Write `maps` so that a kill leaves the whole file or none; a full disk keeps nothing."""
        begun = path.with_name(f'{uuid4().hex}.begun')
        try:
            path.parent.mkdir(exist_ok=True)
            if shutil.disk_usage(path.parent).free < LEAST_FREE_BYTES + maps.nbytes:
                return maps
            with begun.open('wb') as file:
                maps = self.write(file, maps)
            begun.replace(path)
        except OSError:
            begun.unlink(missing_ok=True)
        return maps


def key_of(call: 'partial[Any]') -> str:
    """Return a name for a simulation that depends on all its arguments and on the program."""
    text = described((versions(), call))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def described(value: Any) -> str:
    """Return a text that is the same in every process for equal arguments of a simulation."""
    if isinstance(value, np.ndarray):
        return f'{value.shape}{value.dtype}{hashlib.sha256(value.tobytes()).hexdigest()}'
    if isinstance(value, Rig):
        return value.physics_fingerprint
    if isinstance(value, partial):
        return described((value.func.__qualname__, value.args, value.keywords))
    if isinstance(value, Mapping):
        return described(sorted(value.items()))
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f'[{", ".join(map(described, value))}]'
    return repr(value)


def _timed(call: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    found = call()
    return time.perf_counter() - begin, found
