"""The sand tank of 1904: every photograph is mapped, and the early ones tell the rates."""

from pathlib import Path

import numpy as np
import pytest

from lab.photographs import seepage
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_core.rig.oddities import remarks_about
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.simulation import simulate

RIGS = Path(__file__).resolve().parents[2] / 'rigs'


@pytest.mark.slow
def test_every_photograph_is_mapped_and_shows_all_plumes() -> None:
    if not (seepage.PHOTOGRAPHS / seepage.BASELINE).is_file():
        pytest.skip(f'needs the photographs in {seepage.PHOTOGRAPHS}')
    rig = load_rig(seepage.RIG)
    grid = rig.grid(65, 62)
    seen = seepage.map_photographs(rig, grid, seepage.PHOTOGRAPHS)
    assert [set(one.plumes) for one in seen[1:]] == [set('DEFG')] * 3
    assert all(np.isnan(one.values[~rig.wet_sand(grid)]).mean() > 0.9 for one in seen)
    for rate in seepage.fitted_rates(rig, grid, seen[:2]).values():
        low, high = rate.interval_ml_h
        assert rate.prior_ml_h[0] < low < rate.rate_ml_h < high < rate.prior_ml_h[1]


def test_missing_photographs_are_told_with_their_origin(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='Olsthoorn'):
        seepage.run(tmp_path, tmp_path / 'output')


@pytest.mark.parametrize('name', ['pennink_rain', 'pennink_milk'])
def test_no_rig_is_odd(name: str) -> None:
    assert remarks_about(load_rig(RIGS / name)) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ('name', 'time', 'height', 'near'),
    [('pennink_rain', 17880.0, 0.13, 0.01), ('pennink_milk', 36000.0, 0.23, 0.02)],
)
def test_the_milk_has_risen_to_its_height(
    name: str, time: float, height: float, near: float
) -> None:
    recording = open_recording(RIGS / name)
    grid = recording.rig.default_grid(0.03)
    (found,) = simulate(recording.rig, recording.delivered, [time], grid=grid, preset='fast')
    heights = found.sum(axis=0) * grid.dz
    assert float(np.median(heights)) == pytest.approx(height, abs=near)
