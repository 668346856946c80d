"""What the running graph has seen since its experiment began, as a recording can hold it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRates
from porotwin_diagnosis.data.sample import FILLED_SHARE, share_with_tracer
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.experiment_folder import write_folder
from porotwin_recording.recorded_data import RecordedData
from porotwin_solver.physics import nominal_physics

MOST_MAPS = 400
"""Maps kept; of more, every second is dropped. A diagnosis compares a few dozen."""


ACCOUNTED = 0.5
"""Share of the first map's tracer that the rates before it must have injected."""


@dataclass(frozen=True)
class _Rates:
    """Rates that hold from `start` [s] on; `told` if a set-point asked for them, else measured."""

    start: float
    wells: WellRates
    told: bool


class RunSoFar:
    """Maps and rates since the experiment began; times are stamps of photographs [s].

    Photographs that were missed do not end a run, for the model needs the rates alone; a clock
    that goes back does, and so does the end of the experiment once another one begins. So does a
    new start of the camera's evaluation, unless the rig still holds its tracer: then it is the same
    experiment. Rates that hold when a run begins hold on in it. As for the hub, a set-point counts
    as followed unless rates were measured since.
    """

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Keep maps on `grid`."""
        self._rig = rig
        self._grid = grid
        self._times: list[float] = []
        self._maps: list[FloatArray] = []
        self._rates: list[_Rates] = []
        self._measured_until = -np.inf
        self._finished = False
        self._started = False

    def __len__(self) -> int:
        return len(self._times)

    def saw(self, stamp: float, concentration: FloatArray, grid: Grid) -> None:
        """Keep a map (nz, nx).

        Raises:
            InputError: the map is on another grid.
        """
        if grid != self._grid:
            raise InputError(f'map on {grid}; the run is kept on {self._grid}')
        rinsed = self._started and share_with_tracer(concentration) < FILLED_SHARE
        if self._times and (self._finished or rinsed or stamp <= self._times[-1]):
            self._begin_anew(stamp)
        self._started = False
        self._times.append(stamp)
        self._maps.append(concentration.astype(np.float32))
        if len(self._times) > MOST_MAPS:
            del self._times[1:-1:2], self._maps[1:-1:2]

    def told(self, stamp: float, rates: WellRates) -> None:
        """Keep the rates of a set-point that holds from `stamp` on, until others are measured."""
        if stamp > self._measured_until:
            self._rates.append(_Rates(stamp, dict(rates), told=True))

    def pumped(self, start: float, end: float, rates: WellRates) -> None:
        """Keep the rates of all wells that were measured from `start` to `end`, and hold on."""
        self._rates = [r for r in self._rates if not (r.told and start <= r.start <= end)]
        self._rates.append(_Rates(start, dict(rates), told=False))
        self._measured_until = start

    def started(self) -> None:
        """Note that the evaluation of photographs began: what follows may be a new experiment."""
        self._started = True

    def finished(self) -> None:
        """Note that the experiment is over: what is seen next belongs to another one."""
        self._finished = True

    def _begin_anew(self, stamp: float) -> None:
        self._times, self._maps = [], []
        # topics keep no order between them: what holds may have been told just before
        self._rates = [_Rates(stamp, last.wells, last.told) for last in self._rates[-1:]]
        self._measured_until = -np.inf
        self._finished = False

    def write(self, folder: Path) -> None:
        """Write the run as an experiment folder whose time begins with it.

        Raises:
            InputError: nothing was seen yet, or the run was not seen from its beginning.
        """
        if not self._times:
            raise InputError('diagnosis: the running graph has shown nothing yet; wait a while')
        if not self._rates:
            raise InputError(
                'diagnosis: nobody said what the pumps do, neither set-points nor measured rates; '
                'confirm them (service operator/confirm), or name a recording'
            )
        begin = min(self._times[0], *(rates.start for rates in self._rates))
        schedule = Schedule.from_rates((r.start - begin, r.wells) for r in self._rates)
        self._refuse_tracer_that_nobody_injected(schedule, self._times[0] - begin)
        stack = np.stack(self._maps)
        maps = ConcentrationMaps(
            np.array(self._times) - begin, self._grid, lambda start, stop: stack[start:stop]
        )
        write_folder(folder, RecordedData(self._rig, commanded=schedule, maps=maps))

    def _refuse_tracer_that_nobody_injected(self, schedule: Schedule, first: float) -> None:
        """Refuse a run whose first map, `first` seconds after its rates begin, holds more tracer
        than those rates can have brought."""
        share = share_with_tracer(self._maps[0])
        nominal = nominal_physics(self._rig, self._grid)
        held = float(np.nansum(self._maps[0] * nominal.storage))
        injected = sum(
            (high - low) * sum(max(rate.rate, 0.0) * rate.concentration for rate in rates.values())
            for low, high, rates in schedule.intervals(0.0, first)
        )
        if share > FILLED_SHARE and injected < ACCOUNTED * held:
            raise InputError(
                f'diagnosis: the first map of the run, at {self._times[0]:.0f} s, holds tracer in '
                f'{share:.0%} of the rig, and nobody saw how it got there; start the diagnosis '
                'with the experiment, or name a recording'
            )
