"""The check of the geometry on a drawn laser grid; `test_real_photographs.py` uses a real one."""

import cv2
import numpy as np
import pytest

from lab.photographs.laser_grid_check import check_laser_grid
from porotwin_core.rig import Camera
from porotwin_imaging.geometry.corners_and_lens import Geometry

ROWS, COLUMNS = 600, 1000
SPACING_M = 0.1


def laser_grid(geometry: Geometry) -> bytes:
    """Return a photograph of a perfect grid of red lines."""
    pixels = np.full((ROWS, COLUMNS, 3), 60, np.uint8)
    along = np.linspace(0.0, 1.0, 400)
    for x in np.arange(SPACING_M / 2, 1.0, SPACING_M):
        draw(pixels, geometry, np.full(400, x), 0.6 * along)
    for z in np.arange(SPACING_M / 2, 0.6, SPACING_M):
        draw(pixels, geometry, along, np.full(400, z))
    return cv2.imencode('.png', pixels)[1].tobytes()


def draw(pixels: np.ndarray, geometry: Geometry, x: np.ndarray, z: np.ndarray) -> None:
    points = np.stack(geometry.to_pixels(x, z), axis=1)
    line = np.rint(8 * points).astype(np.int32)
    cv2.polylines(pixels, [line], isClosed=False, color=(60, 60, 220), thickness=3, shift=3)


def geometry(**curvature: float) -> Geometry:
    corners = ((0, 0), (0, ROWS), (COLUMNS, ROWS), (COLUMNS, 0))
    return Geometry.from_camera(Camera(corners_px=corners, curvature=curvature), 1.0, 0.6)


def test_the_geometry_of_the_photograph_makes_the_grid_straight() -> None:
    bent = geometry(vertical_bulge=-2e-7)
    photograph = laser_grid(bent)
    good, ignored = check_laser_grid(photograph, bent), check_laser_grid(photograph, geometry())
    assert good.lines == (10, 6)
    assert good.straightness_m < 0.0003 < 0.001 < ignored.straightness_m
    assert good.spacing < 0.02
    assert good.skew_deg == pytest.approx(0.0, abs=0.05)
