"""Measures of phases in known maps."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import Grid
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, UNKNOWN
from porotwin_imaging.phases.phase_measures import phase_measures
from porotwin_imaging.phases.phase_segmentation import PhaseMap

GRID = Grid(200, 100, 2.0, 1.0)


def disc() -> PhaseMap:
    """A disc of gas with a radius of 0.3 m around (0.8, 0.5) m; the right edge is not seen."""
    x, z = np.meshgrid(GRID.x, GRID.z)
    phase = np.where(np.hypot(x - 0.8, z - 0.5) < 0.3, GAS, 0).astype(np.uint8)
    phase[:, -10:] = UNKNOWN
    confidence = np.where(phase == UNKNOWN, np.nan, 1.0).astype(np.float32)
    confidence[:50][phase[:50] == GAS] = 0.6
    return PhaseMap(phase, confidence, np.zeros_like(phase), [])


def test_a_disc_has_its_area_outline_and_centre() -> None:
    found = phase_measures(disc(), GAS, GRID, np.full(GRID.shape, 1e-6))
    assert found.area_m2 == pytest.approx(np.pi * 0.3**2, rel=0.01)
    assert found.doubt_m2 == pytest.approx(found.area_m2 / 2, rel=0.01)
    assert found.pores_ml == pytest.approx(found.area_m2 / GRID.cell_area)
    assert found.contour_m == pytest.approx(2 * np.pi * 0.3, rel=0.02)
    assert (found.x_m, found.z_m) == pytest.approx((0.8, 0.5), abs=1e-3)
    assert found.parts == 1


def test_a_phase_that_is_not_there_has_no_place() -> None:
    found = phase_measures(disc(), DISSOLVED, GRID, np.ones(GRID.shape))
    assert (found.area_m2, found.contour_m, found.parts) == (0.0, 0.0, 0)
    assert np.isnan(found.x_m)
