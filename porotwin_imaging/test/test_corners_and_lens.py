"""Corners, perspective and curvature, and their inverse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Camera
from porotwin_imaging.geometry.corners_and_lens import Geometry

CORNERS = ((11, 8), (16, 1755), (3165, 1748), (3165, 5))


def geometry(**curvature: float) -> Geometry:
    return Geometry.from_camera(Camera(corners_px=CORNERS, curvature=curvature), 2.8, 1.5)


terms = st.floats(-3e-8, 3e-8)
offsets = st.floats(-200, 200)


@settings(max_examples=50)
@given(terms, terms, terms, terms, offsets, offsets)
def test_corners_do_not_move_and_the_inverse_returns_metres(
    hb: float, vb: float, hs: float, vs: float, ho: float, vo: float
) -> None:
    bent = geometry(
        horizontal_bulge=hb, vertical_bulge=vb, horizontal_stretch=hs, vertical_stretch=vs,
        horizontal_stretch_offset=ho, vertical_bulge_offset=vo,
    )  # fmt: skip
    x, z = np.array([0, 0, 2.8, 2.8]), np.array([1.5, 0, 0, 1.5])
    np.testing.assert_allclose(np.stack(bent.to_pixels(x, z), axis=1), CORNERS, atol=1e-2)
    x, z = np.meshgrid(np.linspace(0, 2.8, 9), np.linspace(0, 1.5, 7))
    back = bent.to_metres(*bent.to_pixels(x, z))
    np.testing.assert_allclose(back[0], x, atol=1e-6)
    np.testing.assert_allclose(back[1], z, atol=1e-6)


def test_a_vertical_bulge_moves_the_middle_of_an_edge_by_the_published_term() -> None:
    corners = ((0, 0), (0, 1000), (2000, 1000), (2000, 0))
    camera = Camera(corners_px=corners, curvature={'vertical_bulge': -2e-8})
    plain = Geometry.from_camera(camera.model_copy(update={'curvature': {}}), 2.0, 1.0)
    bent = Geometry.from_camera(camera, 2.0, 1.0)
    _, straight = plain.to_pixels(np.array([1.0]), np.array([1.0]))
    _, row = bent.to_pixels(np.array([1.0]), np.array([1.0]))
    # Y = -500 at the upper edge, (X1 - X)(X - X0) = 1e6 in the middle: -2e-8 * -500 * 1e6 = 10 px
    assert row[0] - straight[0] == pytest.approx(10.0, abs=1e-3)


def test_the_recipe_of_the_documentation_gives_the_terms_back() -> None:
    """The formulas are those of docs/rig.md, section camera."""
    width, height = 1400.0, 940.0
    corners = ((100, 80), (100, 1020), (1500, 1020), (1500, 80))
    terms = {
        'vertical_bulge': 3.5e-8, 'vertical_bulge_offset': -40.0, 'horizontal_bulge': -2e-8,
        'horizontal_bulge_offset': 25.0, 'horizontal_stretch': 1.5e-8, 'vertical_stretch': -1e-8,
    }  # fmt: skip
    bent = Geometry.from_camera(Camera(corners_px=corners, curvature=terms), 2.0, 1.0)

    def off(x: float, z: float) -> tuple[float, float]:
        """Return how far a point (x, z) [m] lies too far right and too low [px]."""
        column, row = bent.to_pixels(np.array([x]), np.array([z]))
        return column[0] - 100 - width * x / 2, row[0] - 80 - height * (1 - z)

    up, low, left, right = off(1, 1)[1], off(1, 0)[1], off(0, 0.5)[0], off(2, 0.5)[0]
    vertical = 4 * (low - up) / (height * width**2)
    horizontal = 4 * (right - left) / (width * height**2)
    found = {
        'vertical_bulge': vertical,
        'horizontal_bulge': horizontal,
        'vertical_bulge_offset': -2 * (low + up) / (vertical * width**2),
        'horizontal_bulge_offset': -2 * (right + left) / (horizontal * height**2),
        'horizontal_stretch': 32 * (off(1.5, 1)[0] - off(0.5, 1)[0]) / (3 * width**3),
        'vertical_stretch': 32 * (off(0, 0.25)[1] - off(0, 0.75)[1]) / (3 * height**3),
    }
    assert found == pytest.approx(terms, rel=1e-6)


def test_unknown_curvature_is_named() -> None:
    with pytest.raises(InputError, match="unknown term 'barrel'"):
        geometry(barrel=1.0)


@pytest.mark.parametrize(
    ('order', 'words'),
    [
        ((0, 3, 2, 1), 'run clockwise.*mirror them back'),
        ((2, 3, 0, 1), 'do not begin at the upper left.*turn them upright'),
        ((0, 2, 1, 3), 'cross each other'),
    ],
)
def test_corners_in_another_order_are_refused(order, words) -> None:
    camera = Camera(corners_px=tuple(CORNERS[n] for n in order))
    with pytest.raises(InputError, match=words):
        Geometry.from_camera(camera, 2.8, 1.5)
