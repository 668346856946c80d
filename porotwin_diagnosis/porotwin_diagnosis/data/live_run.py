"""The run of a live twin so far, in bounded memory, for a diagnosis as a recording."""

import math
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.photo_interval import LONGEST_GAP_S
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.tracer_share import FILLED_SHARE, tracer_share
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_diagnosis.data.map_file import MapFile
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.tables.concentration import (
    UNKNOWN_ORIGIN,
    ConcentrationMaps,
    MapOrigin,
    MapSeries,
)
from porotwin_recording.tables.recorded_data import RecordedData

MOST_MAPS = 400
"""Largest number of maps that are kept; beyond it every second one is dropped. A diagnosis compares
a few dozen."""


RUN_FOLDER = 'run'
"""The recording of a run so far, beside the report on it."""

KEPT_RUNS = 5
"""Recordings of the newest diagnoses that are kept: one has up to 400 maps, and mending asks for a
diagnosis every 20 minutes. The bag of the twin holds all."""


def forget_old_runs(folder: Path) -> None:
    """Remove the recordings of all but the newest diagnoses in `folder`; their reports stay."""
    runs = folder.glob(f'diagnosis_*/{RUN_FOLDER}')
    for run in sorted(runs, key=lambda path: path.stat().st_mtime)[:-KEPT_RUNS]:
        shutil.rmtree(run, ignore_errors=True)


def is_other_clock(last: float, stamp: float) -> bool:
    """Return whether the clock was set between the photographs at `last` and at `stamp` [s]."""
    return not last < stamp <= last + LONGEST_GAP_S


class LiveRun:
    """Maps and rates since the current experiment began. Times are stamps of photographs [s].

    A new run begins when the clock is set (`is_other_clock`), when an experiment follows an ended
    one, and when the evaluation of photographs starts again on a rig without tracer. Missed
    photographs do not end a run, because the model needs the rates only. Rates in force at the
    beginning of a run stay in force.
    """

    def __init__(self, rig: Rig, grid: Grid, folder: Path | None = None) -> None:
        """Keep maps of `rig` on `grid`, in a file in `folder` or among the temporary files."""
        self._described = self._rig = rig
        self._grid = grid
        # concentration, deviation and systematic deviation, one above the other
        self._maps = MapFile((3 * grid.nz, grid.nx), MOST_MAPS, folder)
        self._deviations_known = False
        self._origin = UNKNOWN_ORIGIN
        self.rates = RateHistory.of(rig)
        """The rates since the beginning of the run."""
        self._ended = False
        self._evaluation_started = False

    def __len__(self) -> int:
        """Return the number of maps."""
        return len(self._maps)

    @property
    def times(self) -> tuple[float, ...]:
        """Stamps of the maps [s]."""
        return self._maps.times

    def add_map(
        self,
        stamp: float,
        concentration: FloatArray,
        grid: Grid,
        *,
        deviation: FloatArray | None = None,
        systematic: FloatArray | None = None,
        origin: MapOrigin = UNKNOWN_ORIGIN,
    ) -> None:
        """Keep the map `concentration` (nz, nx) [-] of the photograph at `stamp` [s].

        Args:
            stamp: time of the photograph [s].
            concentration: its map (nz, nx) [-].
            grid: the grid of the map.
            deviation: standard deviation of the map, if known.
            systematic: its part that is equal in all maps, if known.
            origin: how it was made. The last map speaks for the run.

        Raises:
            InputError: the map is on another grid, or the disk is full.
        """
        if grid != self._grid:
            raise InputError(f'map on {grid}; the run is kept on {self._grid}')
        clean = self._evaluation_started and tracer_share(concentration) < FILLED_SHARE
        if self.times and (self._ended or clean or is_other_clock(self.times[-1], stamp)):
            self._begin_new_run(stamp)
        self._evaluation_started = False
        self.rates.reach(stamp)
        unknown = np.full(grid.shape, np.nan)
        planes = [unknown if part is None else part for part in (deviation, systematic)]
        self._maps.append(stamp, np.concatenate([concentration, *planes]))
        self._origin = origin
        self._deviations_known |= deviation is not None and systematic is not None

    def note_effects(self, effects: Sequence[EffectDescription]) -> None:
        """Note the `effects` of the running model beyond its rig; a diagnosis finds the rest."""
        self._rig = self._described.with_effects(effects)

    def note_evaluation_start(self) -> None:
        """Note that the evaluation of photographs starts; a new experiment may follow."""
        self._evaluation_started = True

    def note_experiment_end(self) -> None:
        """Note that the experiment has ended; the next map belongs to another one."""
        self._ended = bool(self.times)  # a node that has just started knows nothing of it

    def _begin_new_run(self, stamp: float) -> None:
        self._maps.clear()
        self._deviations_known = False
        # topics arrive in any order: the rates in force may have arrived just before the map
        self.rates.begin_anew(stamp)
        self._ended = False

    def write(self, folder: Path) -> None:
        """Write the run as an experiment into `folder`, with times since its beginning.

        Raises:
            InputError: there are no maps or no rates yet.
        """
        if not self.times:
            raise InputError('diagnosis: no map has arrived from the running graph yet; wait')
        begins = self.rates.begins
        if begins is None:
            raise InputError(
                'diagnosis: no rates have arrived, neither setpoints nor measured ones; '
                'confirm the rates (service operator/confirm), or name a recording'
            )
        begin, end = min(self.times[0], begins), max(self.times[-1], begins)
        if self._rig.levels:  # they count from the start
            begin = self.rates.pauses.levels.began
        periods = self.rates.traced(begins, math.nextafter(end, math.inf))
        schedule = Schedule.from_rates((one.start - begin, one.rates) for one in periods)
        maps = self._series(np.array(self.times) - begin)
        rig = self._rig
        if rig.control is not None:  # the rates in force have its pauses, or a person's instead
            control = rig.control.with_pauses({}, rig.control.end_min)
            rig = rig.model_copy(update={'control': control})
        write_folder(folder, RecordedData(rig, commanded=schedule, maps=maps))

    def _series(self, times: NDArray[np.float64]) -> ConcentrationMaps:
        """Return the maps with `times` [s], and their deviations where they are known."""
        series = [MapSeries(times, self._grid, partial(self._read, part)) for part in range(3)]
        deviation, systematic = series[1:] if self._deviations_known else (None, None)
        return ConcentrationMaps(
            times, self._grid, series[0].read, deviation, systematic, self._origin
        )

    def _read(self, part: int, start: int, stop: int) -> FloatArray:
        """Return part 0 (concentration), 1 or 2 (deviations) of the maps `start` to `stop`."""
        rows = slice(part * self._grid.nz, (part + 1) * self._grid.nz)
        return self._maps.read(start, stop)[:, rows]
