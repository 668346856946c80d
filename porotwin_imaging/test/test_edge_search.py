"""The edges of the sand in drawn photographs, which the described corners hit or miss."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from porotwin_core.rig import Camera
from porotwin_imaging.baseline.edge_search import SeenEdge, Side, seen_edges
from porotwin_imaging.geometry.corners_and_lens import Geometry

COLUMNS, ROWS = 1000, 640
LEFT, TOP, RIGHT, BOTTOM = 100, 100, 900, 560
"""The sand in the drawn photographs [px]."""
PX_PER_M = 1000.0
CORNERS = np.array([[LEFT, TOP], [LEFT, BOTTOM], [RIGHT, BOTTOM], [RIGHT, TOP]], float)
SAND, FRAME, WATER, LAYER = (60, 85, 105), (96, 92, 90), (120, 170, 180), (150, 150, 150)
"""Blue-green-red of sand, of a smooth frame and water, and of a layer of pale sand."""
NEAR_M = 0.004
"""Edges are found to this [m]; at this scale it is 4 px."""
FAR_M = 0.01
"""Edges far from their described places, or under a layer of other sand, are found to this [m]."""


@dataclass(frozen=True)
class Drawing:
    """A drawn photograph.

    bow_px: depth of the frame in the middle of the lower side minus that at its ends.
    shadow_px: width of the shadow of the frame on the sand.
    water_px: height of the water above the sand, within the described rig.
    layer_px: height of a layer of another sand on the bottom of the rig.
    framed: False if the sand fills the photograph.
    """

    bow_px: float = 0.0
    shadow_px: int = 0
    water_px: int = 0
    layer_px: int = 0
    framed: bool = True

    def pixels(self) -> NDArray[np.uint8]:
        """Return the photograph."""
        generator = np.random.default_rng(3)
        grains = generator.normal(1.0, 0.25, (ROWS // 2, COLUMNS // 2)).astype(np.float32)
        grains = cv2.resize(grains, (COLUMNS, ROWS), interpolation=cv2.INTER_CUBIC)
        picture = np.clip(grains, 0.2, 2.0)[..., None] * np.array(SAND)
        across = np.linspace(-1, 1, RIGHT - LEFT)
        row, column = np.mgrid[:ROWS, :COLUMNS]
        last = np.interp(column, np.arange(LEFT, RIGHT), BOTTOM - self.bow_px * (1 - across**2))
        inside = (column >= LEFT) & (column < RIGHT) & (row >= TOP) & (row < last)
        edge = np.minimum(column - LEFT, RIGHT - column)
        picture[edge < self.shadow_px] *= 0.6
        picture[inside & (row < TOP + self.water_px)] = WATER
        layer = inside & (row >= BOTTOM - self.layer_px)
        picture[layer] *= np.array(LAYER) / np.array(SAND)
        if self.framed:
            picture[~inside] = FRAME
        picture += generator.normal(0, 1.3, picture.shape)
        return np.clip(picture, 0, 255).astype(np.uint8)


def found(drawing: Drawing, corners: np.ndarray = CORNERS) -> dict[Side, SeenEdge]:
    """Return the edges that are seen in a drawing, described by `corners` [px]."""
    pixels = tuple((float(column), float(row)) for column, row in corners)
    width, height = (RIGHT - LEFT) / PX_PER_M, (BOTTOM - TOP) / PX_PER_M
    geometry = Geometry.from_camera(Camera(corners_px=pixels), width, height)
    return seen_edges(drawing.pixels(), geometry, 1)


def test_described_edges_are_found_where_they_are() -> None:
    edges = found(Drawing())
    assert set(edges) == {'upper', 'lower', 'left', 'right'}
    for edge in edges.values():
        assert max(abs(edge.start), abs(edge.end)) < NEAR_M


@pytest.mark.parametrize(
    ('outward_px', 'error_m'),
    [(-25, NEAR_M), (-15, NEAR_M), (15, NEAR_M), (25, NEAR_M), (-50, FAR_M), (50, FAR_M)],
)
def test_corners_off_on_all_sides_are_measured(outward_px: int, error_m: float) -> None:
    away = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]])
    edges = found(Drawing(), CORNERS + outward_px * away)
    assert set(edges) == {'upper', 'lower', 'left', 'right'}
    along, up = (RIGHT - LEFT + 2 * outward_px) / 0.8, (BOTTOM - TOP + 2 * outward_px) / 0.46
    for edge in edges.values():
        scale = up if edge.side in ('upper', 'lower') else along
        assert edge.start == pytest.approx(outward_px / scale, abs=error_m)
        assert edge.end == pytest.approx(outward_px / scale, abs=error_m)


@pytest.mark.parametrize('layer_px', [15, 35, 50, 65])
def test_the_upper_end_of_a_layer_is_no_edge(layer_px: int) -> None:
    lower = found(Drawing(layer_px=layer_px)).get('lower')
    assert lower is None or lower.distance < FAR_M


def test_one_wrong_corner_leaves_the_other_ends_in_place() -> None:
    corners = CORNERS + np.array([[-18, 0], [0, 0], [0, 0], [0, 0]])
    left = found(Drawing(), corners)['left']
    assert left.end == pytest.approx(0.018, abs=NEAR_M)
    assert left.start == pytest.approx(0.0, abs=NEAR_M)


def test_the_ends_of_a_bowed_edge_are_right() -> None:
    lower = found(Drawing(bow_px=12))['lower']
    assert max(abs(lower.start), abs(lower.end)) < NEAR_M


def test_the_shadow_of_a_frame_is_no_edge() -> None:
    left = found(Drawing(shadow_px=18))['left']
    assert max(abs(left.start), abs(left.end)) < NEAR_M


def test_water_below_a_rim_is_no_wrong_corner() -> None:
    upper = found(Drawing(water_px=30)).get('upper')
    assert upper is None or upper.end < NEAR_M


def test_sand_without_an_edge_shows_none() -> None:
    assert not found(Drawing(framed=False))


def test_a_photograph_that_ends_at_the_rig_shows_no_edge() -> None:
    cut = Drawing().pixels()[TOP:BOTTOM, LEFT:RIGHT]
    corners = tuple((float(c - LEFT), float(r - TOP)) for c, r in CORNERS)
    geometry = Geometry.from_camera(Camera(corners_px=corners), 0.8, 0.46)
    assert not seen_edges(np.ascontiguousarray(cut), geometry, 1)


def test_a_rig_outside_the_photograph_has_no_edge() -> None:
    assert not found(Drawing(), CORNERS + np.array([2 * COLUMNS, 0]))
