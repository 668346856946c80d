"""Predictions for Pennink's series 3 and 5, beside his words.

    .venv/bin/python -m lab.photographs.rain_and_milk

`rigs/pennink_rain` and `rigs/pennink_milk` are run as `simulate` runs them. Nothing is fitted.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from porotwin_core.basis.units import HOUR_S, MINUTE_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import with_rises
from porotwin_core.rig import Rig
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate
from porotwin_solver.model.water_balance import water_balance

RIGS = Path(__file__).resolve().parents[2] / 'rigs'
MILK_BEGAN_H = 9.0 + 35.0 / 60.0
"""Begin of the rates of pennink_rain [h]."""
RISEN_S, SHOWN_S = 17880.0, 104400.0
"""14:33, when the milk stood at 0.13 m, and 14:35 of the next day, when it showed in the canal."""
SHOWS = 0.5
"""Concentration of milk that shows in the canal."""
SLOPES_MIN = {'1:5': 620.0, '1:10': 830.0}
"""Minutes of pennink_milk when Pennink measured the flow."""


def rain() -> Iterator[tuple[str, str]]:
    """Yield the words of Pennink on the rain, and the predictions."""
    recording = open_recording(RIGS / 'pennink_rain')
    rig, rates = recording.rig, recording.delivered
    grid = rig.default_grid(0.01)
    table = Model(rig, grid, preset='fast').engine.table(rates.at(SHOWN_S))
    heights = table.surface.sum(axis=0) * table.physics.grid.dz
    canal = rig.water['canal']
    assert rig.water_table is not None
    assert canal.head_m is not None
    above = 1e3 * (float(heights.max()) - rig.water_table.fringe_m - canal.head_m)
    yield 'rain of 4.2 l/h: 7.5 mm (6 mm in series 1)', f'{above:.1f} mm'
    times = [RISEN_S, *np.arange(RISEN_S, SHOWN_S + HOUR_S, 0.5 * HOUR_S)]
    risen, *later = simulate(rig, rates, times, grid=grid, preset='fast')
    yield 'milk at 0.13 m at 14:33', f'{float(np.median(risen.sum(axis=0))) * grid.dz:.3f} m'
    water = _cells(rig, 'canal', grid)
    shown = [time for time, one in zip(times[1:], later, strict=True) if one[water].max() > SHOWS]
    hour = MILK_BEGAN_H + shown[0] / HOUR_S if shown else np.nan
    yield 'milk shows in the canal at 14:35 next day', f'{hour - 24.0:+.1f} h after midnight'


def milk() -> Iterator[tuple[str, str]]:
    """Yield the told and the predicted flow to the canal, without milk."""
    rig = open_recording(RIGS / 'pennink_milk').rig
    grid = rig.default_grid(0.01)
    levels = WaterLevels.of(rig)
    for (slope, minute), told in zip(SLOPES_MIN.items(), (60, 18), strict=True):
        balance = water_balance(rig, grid, with_rises({}, levels.at(minute * MINUTE_S)))
        assert balance is not None
        flow = -1e-3 * balance.in_ml_h['places']['middle']
        yield f'slope {slope}: {told} l/h', f'{flow:.0f} l/h'


def _cells(rig: Rig, name: str, grid: Grid) -> np.ndarray:
    """Return the cells (nz, nx) of a canal."""
    centres = np.stack(np.meshgrid(grid.x, grid.z), axis=-1)
    corners = np.array(rig.water[name].corners_m)
    return inside(centres.reshape(-1, 2), corners).reshape(grid.shape)


def main() -> None:
    """Print a line for each figure."""
    for told, predicted in (*rain(), *milk()):
        print(f'{told}: predicted {predicted}', flush=True)


if __name__ == '__main__':
    main()
