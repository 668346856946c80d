"""Many simulations at once: the same call on one machine's cores and on a Dask cluster."""

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
    """One simulation: the arguments of `simulate`."""

    rig: Rig
    schedule: Schedule
    times: Sequence[float] | FloatArray
    grid: Grid
    preset: str = 'accurate'
    effects: tuple[EffectDescription, ...] = ()

    def run(self) -> FloatArray:
        """Return the maps (nt, nz, nx) of this simulation."""
        return simulate(
            self.rig,
            self.schedule,
            self.times,
            grid=self.grid,
            preset=self.preset,
            effects=self.effects,
        )


class Client(Protocol):
    """What of `distributed.Client` is used here."""

    def map(self, function: object, *iterables: object, **options: object) -> list[object]:
        """Submit one call per item."""

    def gather(self, futures: list[object]) -> list[FloatArray]:
        """Wait for all of them."""


def simulate_many(
    jobs: Iterable[Job], *, client: Client | None = None, workers: int | None = None
) -> list[FloatArray]:
    """Return the maps (nt, nz, nx) of every job, in their order.

    Without a `client`, threads on `workers` cores (all of them by default): the kernels run
    without the interpreter's lock. With a `distributed.Client`, the workers of its cluster.

    Raises:
        InputError: that of the first job that is refused.
    """
    listed = list(jobs)
    if client is not None:
        return client.gather(client.map(Job.run, listed, pure=False))
    with ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        return list(pool.map(Job.run, listed))
