"""Corners, perspective and curvature, and their inverse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from porotwin_core.errors import InputError
from porotwin_core.rig import Camera
from porotwin_imaging.geometry import Geometry

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
