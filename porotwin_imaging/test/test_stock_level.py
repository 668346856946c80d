"""The signal of tracer stock in each sand."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.calibrating.stock_level import diluted_signals, stock_levels

Z, X = np.mgrid[0:100, 0:160]
LABELS = (Z >= 60).astype(np.uint8)
STRENGTH = np.array([1.0, 0.6])[LABELS]


def plume(radius: float, level: float = 1.0) -> np.ndarray:
    grains = 1 + 0.03 * np.random.default_rng(4).normal(size=Z.shape)
    front = 0.5 * (1 - np.tanh((np.hypot(X - 60, Z - 50) - radius) / 2.0))
    return level * front * grains * STRENGTH


def test_each_sand_with_a_core_shows_its_stock() -> None:
    found = stock_levels([plume(30), plume(38), plume(45)], LABELS, [1.0] * 3)
    assert found.levels[0].level == pytest.approx(1.0, rel=0.01)
    assert found.levels[1].level == pytest.approx(0.6, rel=0.02)
    assert found.levels[0].deviation < 0.02


def test_a_core_of_half_stock_counts_as_half() -> None:
    found = stock_levels([plume(30, 0.5), plume(38, 0.5)], LABELS, [0.5, 0.5])
    assert found.levels[0].level == pytest.approx(1.0, rel=0.01)


def test_tracer_that_creeps_into_a_fine_sand_is_no_core() -> None:
    creeping = plume(30) * np.where(LABELS == 1, np.clip((66 - Z) / 6, 0, 1), 1.0)
    found = stock_levels([creeping], LABELS, [1.0])
    assert set(found.levels) == {0}


def test_dilutions_are_read_in_every_sand() -> None:
    factors = 1 / STRENGTH
    pairs = diluted_signals([(0.5, plume(40, 0.5))], LABELS, factors)
    assert [concentration for concentration, _ in pairs] == [0.5, 0.5]
    assert [signal for _, signal in pairs] == pytest.approx([0.5, 0.5], rel=0.02)


def test_a_dilution_without_an_even_plume_is_refused() -> None:
    spread = np.exp(-((np.hypot(X - 60, Z - 30) / 12) ** 2))
    with pytest.raises(InputError, match='shows no even plume'):
        diluted_signals([(0.5, spread)], LABELS, np.ones(Z.shape))


@pytest.mark.parametrize('signal', [0.0, -0.01, np.nan])
def test_a_baseline_named_as_a_dilution_is_refused(signal) -> None:
    with pytest.raises(InputError, match='shows no even plume'):
        diluted_signals([(0.5, np.full(Z.shape, signal))], LABELS, np.ones(Z.shape))
