"""What the running graph has seen since its experiment began, as a recording can hold it."""

from pathlib import Path

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRates
from porotwin_diagnosis.evidence import FILLED_SHARE, TRACER
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.experiment import write_experiment

MOST_MAPS = 400
"""Maps kept; of more, every second is dropped. A diagnosis compares a few dozen."""


class RunSoFar:
    """Maps and rates since the experiment began; times are stamps of photographs [s].

    Photographs that were missed do not end a run, for the model needs the rates alone; a clock
    that goes back does, and so does the end of the experiment once another one begins. Rates that
    hold when a run begins hold on in it.
    """

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Keep maps on `grid`."""
        self._rig = rig
        self._grid = grid
        self._times: list[float] = []
        self._maps: list[FloatArray] = []
        self._rates: list[tuple[float, WellRates]] = []
        self._finished = False

    def __len__(self) -> int:
        return len(self._times)

    def saw(self, stamp: float, concentration: FloatArray, grid: Grid) -> None:
        """Keep a map (nz, nx).

        Raises:
            InputError: the map is on another grid.
        """
        if grid != self._grid:
            raise InputError(f'map on {grid}; the run is kept on {self._grid}')
        if self._times and (self._finished or stamp <= self._times[-1]):
            self._begin_anew(stamp)
        self._times.append(stamp)
        self._maps.append(concentration.astype(np.float32))
        if len(self._times) > MOST_MAPS:
            del self._times[1:-1:2], self._maps[1:-1:2]

    def pumped(self, start: float, rates: WellRates) -> None:
        """Keep the rates of all wells that hold from `start` on."""
        self._rates.append((start, dict(rates)))

    def finished(self) -> None:
        """Note that the experiment is over: what is seen next belongs to another one."""
        self._finished = True

    def _begin_anew(self, stamp: float) -> None:
        self._times, self._maps = [], []
        # topics keep no order between them: what holds may have been told just before
        self._rates = [(stamp, rates) for _, rates in self._rates[-1:]]
        self._finished = False

    def write(self, folder: Path) -> None:
        """Write the run as an experiment folder whose time begins with it.

        Raises:
            InputError: nothing was seen yet, or the run was not seen from its beginning.
        """
        if not self._times:
            raise InputError('diagnosis: the running graph has shown nothing yet; wait a while')
        begin = min([self._times[0], *(start for start, _ in self._rates)])
        share = float(np.mean(self._maps[0] > TRACER))
        if self._times[0] == begin and share > FILLED_SHARE:
            raise InputError(
                f'diagnosis: the first map of the run, at {begin:.0f} s, holds tracer in '
                f'{share:.0%} of the rig, and nobody saw how it got there; start the diagnosis '
                'with the experiment, or name a recording'
            )
        stack = np.stack(self._maps)
        maps = ConcentrationMaps(
            np.array(self._times) - begin, self._grid, lambda start, stop: stack[start:stop]
        )
        told = Schedule.from_rates((start - begin, rates) for start, rates in self._rates)
        write_experiment(folder, rig=self._rig, told=told, maps=maps)
