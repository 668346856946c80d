"""The rigs of Pennink's later series: they are whole, and the milk stands where he tells it."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.rig import load_rig
from porotwin_core.rig.oddities import remarks_about
from porotwin_recording.experiment.recording import open_recording
from porotwin_solver.model.simulation import simulate

RIGS = Path(__file__).resolve().parents[2] / 'rigs'


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
