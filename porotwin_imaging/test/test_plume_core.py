"""The core of a plume."""

import numpy as np
import pytest

from porotwin_imaging.calibrating.plume_core import find_core, plume_depth, strong_signal

Z, X = np.mgrid[0:100, 0:160]


def disc(width: float, level: float = 1.0, radius: float = 30.0) -> np.ndarray:
    grains = 1 + 0.03 * np.random.default_rng(4).normal(size=Z.shape)
    return level * grains * 0.5 * (1 - np.tanh((np.hypot(X - 60, Z - 50) - radius) / width))


def test_the_core_has_the_level_of_stock_whatever_the_front() -> None:
    for width in (1.0, 4.0, 8.0):
        signal = disc(width, level=1.8)
        core = find_core(signal, plume_depth(signal, strong_signal([signal])))
        assert core is not None
        assert core.level == pytest.approx(1.8, rel=0.01)
        assert abs(core.flatness) < 0.02


def test_a_paler_plume_beside_it_is_no_core() -> None:
    signal = disc(3.0) + 0.5 * (np.hypot(X - 130, Z - 50) < 20)
    core = find_core(signal, plume_depth(signal, strong_signal([signal])))
    assert core is not None
    assert core.level == pytest.approx(1.0, rel=0.01)
    assert not core.cells[:, 105:].any()


def test_a_plume_that_has_spread_rises_inwards() -> None:
    signal = np.exp(-((np.hypot(X - 60, Z - 50) / 25) ** 2))
    core = find_core(signal, plume_depth(signal, strong_signal([signal])))
    assert core is None or core.flatness > 0.025


def test_few_cells_are_no_core() -> None:
    signal = disc(0.5, radius=2.0)
    assert find_core(signal, plume_depth(signal, 1.0)) is None
