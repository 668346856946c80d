"""The time of a map of phases within a series."""

import numpy as np
import pytest

from porotwin_imaging.phases.phase_colours import UNKNOWN
from porotwin_imaging.phases.phase_series import phase_overlap, series_match


def disc(time: float, shape: tuple[int, int] = (60, 80)) -> np.ndarray:
    """Return a plume that grows with the square root of time, with gas in its core."""
    z, x = np.mgrid[: shape[0], : shape[1]] * 60.0 / shape[0]
    away = np.hypot(z - 30, x - 40) / np.sqrt(time)
    return np.where(away < 0.2, 2, np.where(away < 0.4, 1, 0)).astype(np.uint8)


def test_overlap_counts_the_same_phase_of_co2_only() -> None:
    first, second = (np.array(row, np.uint8) for row in ([0, 1, 1, 2, UNKNOWN], [0, 1, 2, 2, 1]))
    assert phase_overlap(first, second) == pytest.approx(2 / 3)
    assert phase_overlap(first[:1], second[:1]) == 1.0


@pytest.mark.parametrize('shape', [(60, 80), (120, 160)])
def test_the_time_is_found_between_the_maps(shape) -> None:
    series = {float(time): disc(time) for time in range(600, 6001, 600)}
    match = series_match(disc(2650.0, shape), series)
    assert match.map_time_s == 2400.0
    assert match.time_s == pytest.approx(2650.0, rel=0.05)


def test_at_the_end_of_a_series_its_last_map_is_found() -> None:
    series = {1000.0: disc(1000.0), 2000.0: disc(2000.0)}
    assert series_match(disc(9000.0), series).time_s == 2000.0
