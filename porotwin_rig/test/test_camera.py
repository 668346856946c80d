"""The virtual camera: geometry and its inverse, and the description in rig.yaml."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig_examples import make_rig

from porotwin_rig.camera import CHART_WIDTH, SceneLayout, VirtualCamera, camera_before
from porotwin_rig.chart import PATCHES, chart_colours

LAYOUT = SceneLayout(0.934, 0.562)


@given(
    x=st.floats(-0.02, 0.95),
    z=st.floats(-0.02, 0.65),
    bulge=st.floats(-0.05, 0.02),
    tilt=st.floats(0.0, 0.02),
)
def test_pixels_and_metres_are_inverse(x: float, z: float, bulge: float, tilt: float) -> None:
    camera = VirtualCamera(LAYOUT, 1600, 1000, tilt=tilt, bulge=bulge)
    column, row = camera.to_pixels(np.array(x), np.array(z))
    again = camera.to_metres(column, row)
    assert np.allclose(again, (x, z), atol=2e-6)


def test_whole_scene_is_in_view_and_the_right_way_up() -> None:
    for rig in (make_rig(), make_rig(width_m=2.8, height_m=1.5)):
        camera = camera_before(rig, 1600, 900)
        corners = np.array(camera.description().corners_px)
        assert (corners > 0).all()
        assert (corners < [1600, 900]).all()
        upper_left, lower_left, lower_right, upper_right = corners
        assert upper_left[1] < lower_left[1]
        assert upper_right[0] > upper_left[0]
        assert lower_right[0] > lower_left[0]


def test_lens_bends_straight_lines_by_several_pixels() -> None:
    camera = VirtualCamera(LAYOUT, 1600, 1000)
    x = np.linspace(0, 0.934, 101)
    column, row = camera.to_pixels(x, np.full(101, 0.562))
    straight = np.interp(column, column[[0, -1]], row[[0, -1]])
    assert 2.0 < np.abs(row - straight).max() < 30.0


@pytest.mark.parametrize('width', [1600, 7952])
def test_curvature_terms_describe_the_lens_to_a_fraction_of_a_pixel(width: int) -> None:
    camera = camera_before(make_rig(), width, round(width * 0.6))
    description = camera.description()
    terms = description.curvature
    corners = np.array(description.corners_px)
    columns = max(np.linalg.norm(corners[3] - corners[0]), np.linalg.norm(corners[2] - corners[1]))
    rows = max(np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[2] - corners[3]))
    # written out once more, in the order of the published correction
    import cv2

    crop = np.array([[0, 0], [0, rows], [columns, rows], [columns, 0]], np.float32)
    homography = cv2.getPerspectiveTransform(crop, corners.astype(np.float32))
    x, z = np.meshgrid(np.linspace(0, 0.934, 23), np.linspace(0, 0.562, 17))
    u, v = x * columns / 0.934, rows - z * rows / 0.562

    def centred(value: np.ndarray, size: float, term: str) -> np.ndarray:
        return terms[term] * (value - size / 2 - terms[term + '_offset'])

    u, v = (
        u + centred(u, columns, 'horizontal_stretch') * (columns - u) * u,
        v + centred(v, rows, 'vertical_stretch') * (rows - v) * v,
    )
    u, v = (
        u + centred(u, columns, 'horizontal_bulge') * (rows - v) * v,
        v + centred(v, rows, 'vertical_bulge') * (columns - u) * u,
    )
    found = cv2.perspectiveTransform(np.stack((u, v), axis=-1).reshape(1, -1, 2), homography)
    seen = np.stack(camera.to_pixels(x, z), axis=-1).reshape(-1, 2)
    assert np.abs(found[0] - seen).max() < 2e-4 * width


def test_chart_hangs_upright_with_dark_skin_first() -> None:
    chart = np.array(camera_before(make_rig()).description().colour_checker_px)
    dark_skin, white, black, bluish_green = chart
    assert dark_skin[0] < bluish_green[0]
    assert dark_skin[1] < white[1]
    assert white[0] < black[0]
    assert LAYOUT.chart_point(6, 0)[0] - LAYOUT.chart_point(0, 0)[0] == pytest.approx(CHART_WIDTH)


def test_chart_has_the_published_colours() -> None:
    colour = pytest.importorskip('colour')
    published = colour.CCS_COLOURCHECKERS['ColorChecker24 - After November 2014']
    for (name, ours), theirs in zip(PATCHES.items(), published.data.values(), strict=True):
        linear = colour.XYZ_to_sRGB(
            colour.xyY_to_XYZ(theirs), published.illuminant, 'Bradford', apply_cctf_encoding=False
        )
        assert np.allclose(ours, linear, atol=6e-5), name


def test_chart_shows_its_patches_row_by_row() -> None:
    columns, rows = np.meshgrid(np.arange(6) + 0.5, np.arange(4) + 0.5)
    shown = chart_colours(columns, rows).reshape(24, 3)
    assert np.allclose(shown, np.maximum(list(PATCHES.values()), 0.0))
