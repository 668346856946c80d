"""Many simulations at once, on the cores of one machine or on a Dask cluster."""

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.wells import Schedule
from porotwin_solver.simulation import simulate


@dataclass(frozen=True)
class Job:
    """One simulation: the arguments of `simulate`; `times` [s] are those of the maps."""

    rig: Rig
    schedule: Schedule
    times: Sequence[float] | FloatArray
    grid: Grid
    preset: str = 'accurate'
    effects: tuple[EffectDescription, ...] = ()

    def run(self) -> FloatArray:
        """Return the maps (nt, nz, nx) of this simulation.

        Raises:
            InputError: as `simulate`.
        """
        return simulate(
            self.rig,
            self.schedule,
            self.times,
            grid=self.grid,
            preset=self.preset,
            effects=self.effects,
        )


class Client(Protocol):
    """The part of `distributed.Client` that `simulate_many` uses."""

    def map(self, function: object, *iterables: object, **options: object) -> list[object]:
        """Submit one call per item and return their futures."""

    def gather(self, futures: list[object]) -> list[FloatArray]:
        """Wait for all futures and return their maps (nt, nz, nx), in the same order."""


def simulate_many(
    jobs: Iterable[Job], *, client: Client | None = None, workers: int | None = None
) -> list[FloatArray]:
    """Return the maps (nt, nz, nx) of every job, in the order of the jobs.

    Without a `client`, the jobs run in threads on `workers` cores, by default on all of them; the
    kernels release the interpreter's lock. With a `distributed.Client` they run on its cluster.

    Raises:
        InputError: the first job that is refused, as `simulate`.
    """
    listed = list(jobs)
    if client is not None:
        return client.gather(client.map(Job.run, listed, pure=False))
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        return list(pool.map(Job.run, listed))
