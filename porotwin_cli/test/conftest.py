"""A small experiment of the virtual rig, shared by the tests of the commands."""

from pathlib import Path

import pytest
from kept_baselines import kept_baselines
from large_elements import large_elements
from undrawn_pictures import undrawn

from porotwin_cli.workspace import small_rig
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig

__all__ = ['kept_baselines', 'large_elements', 'undrawn']


@pytest.fixture(scope='session')
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return three minutes of the small rig on a coarse grid, with photographs."""
    folder = tmp_path_factory.mktemp('made') / 'experiment'
    rig = load_rig(small_rig())
    rate = from_ml_h(500.0)
    schedule = Schedule(
        (
            ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),
            ScheduleRow(0.0, 'producer', WellRate(-rate)),
        )
    )
    make_experiment(
        folder,
        VirtualRig(rig, cell=0.0042),
        commanded=schedule,
        duration=180.0,
        photo_interval=30.0,
        seed=3,
        grid=rig.grid(94, 56),
        photo_width_px=640,
    )
    return folder
