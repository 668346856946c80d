"""Tests of zones on a grid: distances and the fuzzy mask."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.zone_shapes import PolygonZone
from porotwin_hub.objectives.zones import distance_to_zones, fuzzy_mask


def test_the_mask_falls_from_one_to_zero_over_the_fuzziness(square: FloatArray) -> None:
    grid = Grid(100, 100, 1.0, 1.0)
    distance = distance_to_zones((PolygonZone(square),), grid)
    mask = fuzzy_mask(distance, 0.1)
    assert mask.min() == 0.0
    assert mask.max() == 1.0
    row = mask[40]
    assert (row[20:60] == 1.0).all()
    assert row[65] == pytest.approx(0.5, abs=0.1)
    assert (row[71:] == 0.0).all()
    assert (np.diff(row[59:71]) < 0).all()


def test_without_fuzziness_the_mask_is_the_zone(square: FloatArray) -> None:
    grid = Grid(50, 50, 1.0, 1.0)
    mask = fuzzy_mask(distance_to_zones((PolygonZone(square),), grid), 0.0)
    assert set(np.unique(mask)) == {0.0, 1.0}
    assert mask.mean() == pytest.approx(0.16)
