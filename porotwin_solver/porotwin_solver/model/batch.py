"""Many simulations at once, on the cores of one machine or on a Dask cluster."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from porotwin_core.basis.parallel import crew
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.model.simulation import simulate


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


def simulate_many(
    jobs: Iterable[Job], *, workers: int | None = None, scheduler: str = ''
) -> list[FloatArray]:
    """Return the maps (nt, nz, nx) of every job, in the order of the jobs.

    The jobs run in `workers` threads, as the kernels release the interpreter's lock, or on the
    workers of the Dask cluster at the address `scheduler`; see `porotwin_core.basis.parallel.crew`.

    Raises:
        InputError: the first job that is refused, as `simulate`; or no scheduler answers.
    """
    with crew(workers=workers, scheduler=scheduler, threads=True) as pool:
        return list(pool.map(Job.run, jobs))
