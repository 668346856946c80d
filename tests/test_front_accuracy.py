"""Errors of the presets at sharp fronts, against the virtual rig, which follows them exactly."""

import numpy as np
import pytest

from lab.benches.bench_fronts import CHARACTERISTIC_PARTS, SLUG_TIMES, slug
from lab.benches.bench_solver import bench_rig
from porotwin_core.geometry.grid import FloatArray
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.simulation import simulate


@pytest.fixture(scope='module')
def truth() -> FloatArray:
    """The signal of the virtual rig, whose cells are 2.5 times smaller than those of the maps."""
    rig = bench_rig()
    grid = rig.grid(187, 112)
    asset = VirtualRig(rig, cell=grid.dx / CHARACTERISTIC_PARTS)
    return np.array([seen for _, seen in signals(asset, slug(), times=SLUG_TIMES, grid=grid)])


def errors(preset: str, truth: FloatArray) -> FloatArray:
    """Return the relative L2 error of each map."""
    rig = bench_rig()
    maps = simulate(rig, slug(), SLUG_TIMES, grid=rig.grid(187, 112), preset=preset)
    difference = np.linalg.norm((maps - truth).reshape(len(SLUG_TIMES), -1), axis=1)
    norm: FloatArray = np.linalg.norm(truth.reshape(len(SLUG_TIMES), -1), axis=1)
    return difference / norm


def test_the_sharp_preset_keeps_fronts(truth: FloatArray) -> None:
    sharp = errors('sharp', truth)
    assert sharp.max() < 0.025  # of which 0.017 is the error of the virtual rig on these cells
    assert (sharp < 0.4 * errors('fast', truth)).all()
    assert (sharp < 0.6 * errors('accurate', truth)).all()
