"""Maps of very many cells are averaged for a diagnosis; others stay as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import load_rig
from porotwin_diagnosis.data.fewer_cells import with_fewer_cells
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps, MapSeries

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

RIG = load_rig(RIGS / 'small')
TIMES = np.arange(5) * 60.0


def recording(grid: Grid) -> Recording:
    """Return five maps of noise with standard deviations; one cell is not seen."""
    maps = np.random.default_rng(1).random((len(TIMES), *grid.shape)).astype(np.float32)
    maps[2, 5, 7] = np.nan

    def series(values: np.ndarray) -> MapSeries:
        return MapSeries(TIMES, grid, lambda start, stop: values[start:stop])

    shown = ConcentrationMaps(
        TIMES,
        grid,
        lambda start, stop: maps[start:stop],
        deviation=series(0.5 * np.abs(maps)),
        systematic=series(0.1 * np.abs(maps)),
    )
    return Recording(RIG, maps=shown, source=Path('run'))


def test_few_cells_stay_as_they_are() -> None:
    told: list[str] = []
    fine = recording(RIG.grid(100, 60))
    assert with_fewer_cells(fine, told.append) is fine
    assert not told


@pytest.mark.parametrize(('columns', 'rows'), [(40, 24), (41, 25)])
def test_averages_keep_the_tracer_and_the_hole(columns: int, rows: int) -> None:
    told: list[str] = []
    fine = recording(RIG.grid(columns, rows))
    coarse = with_fewer_cells(fine, told.append, most_cells=300)
    maps, before = coarse.present_maps, fine.present_maps
    assert coarse.grid.nx * coarse.grid.nz <= 300
    assert told == [f'run: the maps of {fine.grid} cells are averaged over {coarse.grid} cells']
    assert maps[1:3].shape == (2, *coarse.grid.shape)
    assert maps[0].mean() == pytest.approx(before[0].mean(), rel=1e-5)
    assert maps.deviation is not None and maps.systematic is not None
    assert maps.deviation[0] == pytest.approx(5.0 * maps.systematic[0], rel=1e-4)
    x, z = before.grid.x[7], before.grid.z[5]
    hole = np.argwhere(np.isnan(maps[2]))
    distance = np.hypot(maps.grid.z[hole[:, 0]] - z, maps.grid.x[hole[:, 1]] - x)
    assert 1 <= len(hole) <= 4 and distance.max() < 1.5 * maps.grid.dx
    assert replace(coarse, maps=None) == replace(fine, maps=None)
