"""Tests of the projected gradient: the projection is the nearest point, the search descends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.geometry.grid import FloatArray
from porotwin_hub.control.projected_gradient import descend, project

RATES = st.lists(st.floats(-2.0, 3.0), min_size=3, max_size=3)


@given(rates=RATES, others=st.lists(RATES, min_size=1, max_size=5))
def test_no_other_point_within_the_limits_is_nearer(
    rates: list[float], others: list[list[float]]
) -> None:
    greatest, total = np.array([1.0, 0.5, 1.0]), 1.2
    wanted = np.array([rates])
    found = project(wanted, greatest, total)
    assert (found >= 0.0).all()
    assert (found <= greatest).all()
    assert found.sum() <= total + 1e-12
    for other in others:
        inside = np.clip(np.array(other), 0.0, greatest)
        inside *= min(1.0, total / max(inside.sum(), 1e-12))
        distance = np.linalg.norm(wanted - inside)
        assert np.linalg.norm(wanted - found) <= distance + 1e-9


def test_the_search_finds_the_minimum_of_a_parabola_on_the_limits() -> None:
    best = np.array([[0.9, 0.9, 0.0], [0.2, 0.1, 0.3]])
    stiff = np.array([[1.0], [5.0]])

    def parabola(rates: FloatArray) -> tuple[float, FloatArray]:
        return float((stiff * (rates - best) ** 2).sum()), 2.0 * stiff * (rates - best)

    found = descend(
        parabola,
        np.zeros((2, 3)),
        lengths=np.array([1.0, 5.0]),
        greatest=np.ones(3),
        total=1.0,
        iterations=20,
    )
    np.testing.assert_allclose(found, [[0.5, 0.5, 0.0], [0.2, 0.1, 0.3]], atol=2e-3)


def test_a_well_that_may_not_pump_stays_off() -> None:
    def downhill(rates: FloatArray) -> tuple[float, FloatArray]:
        return -float(rates.sum()), -np.ones(rates.shape)

    found = descend(
        downhill,
        np.zeros((1, 2)),
        lengths=np.ones(1),
        greatest=np.array([0.0, 1.0]),
        total=5.0,
        iterations=5,
    )
    assert found.tolist() == [[0.0, 1.0]]


@pytest.mark.parametrize('slope', [0.0, 1.0])
def test_the_search_never_ends_on_a_worse_point(slope: float) -> None:
    def rough(rates: FloatArray) -> tuple[float, FloatArray]:
        return 1.0 + float(np.abs(np.sin(40.0 * rates)).sum()), -slope * np.ones(rates.shape)

    start = np.zeros((2, 2))
    found = descend(rough, start, lengths=np.ones(2), greatest=np.ones(2), total=9.0, iterations=9)
    assert rough(found)[0] <= rough(start)[0]
