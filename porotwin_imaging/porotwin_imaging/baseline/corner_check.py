"""Checks of the corners of a rig.

Corners that were read in a smaller copy of the photograph lie close together. Other wrong corners
lie off the edges of the sand, as far as the photograph shows these.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.remark import Remark
from porotwin_core.rig import Camera, Rig
from porotwin_imaging.baseline.edge_search import SeenEdge, Side, seen_edges
from porotwin_imaging.geometry.corners_and_lens import Geometry

SMALL_IN_PHOTOGRAPH = 0.1
"""Part of a photograph below which the rig is suspiciously small in it."""

HALF = 0.52
"""Corners of a copy of half the size lie within this share of width and height: a little more than
half, because corners of a rig may lie just outside the photograph."""

KEY = 'camera.corners_px in rig.yaml'

SMALL = (
    'the rig covers {share:.0%} of the photograph of {width} x {height} px{quarter}; were they '
    'read in a copy of another size? correct them'
)

LEAST_OFF = 0.01
"""Distance of a corner from an edge of the sand that is told, relative to the longer side of the
rig [-]. Corners that people marked with care are off by up to half of it."""

FRAME_SHARE = 0.03
"""Distance of all corners from the rim of the photograph, relative to the longer side of the rig
[-], from which on the photograph shows what lies around the rig."""

CORNERS: tuple[tuple[str, tuple[Side, bool], tuple[Side, bool]], ...] = (
    ('upper left', ('left', True), ('upper', False)),
    ('lower left', ('left', False), ('lower', False)),
    ('lower right', ('right', False), ('lower', True)),
    ('upper right', ('right', True), ('upper', True)),
)
"""The corners in the order of `camera.corners_px`: name, and its two sides with True where the
corner lies at the end of the side."""


def odd_corners(
    rig: Rig, pixels: NDArray[np.uint8], size: tuple[int, int], reduction: float
) -> Remark | None:
    """Return the remark that the corners belong to a smaller copy, or lie off the sand.

    The file has the `size` [px]; `corners_off_the_sand` describes the other arguments.
    """
    assert rig.camera is not None
    small = small_rig(rig.camera.corners_px, size)
    return small or corners_off_the_sand(rig, pixels, reduction)


def small_rig(corners: Sequence[tuple[float, float]], size: tuple[int, int]) -> Remark | None:
    """Return a remark about a rig of small size in its photograph; None for other rigs.

    Args:
        corners: columns and rows of the corners [px].
        size: width and height of the photograph [px].
    """
    places = np.array(corners) / np.array(size)
    part = float(np.prod(np.ptp(places, axis=0)))
    in_one_half = (places <= HALF).all(axis=0) | (places >= 1.0 - HALF).all(axis=0)
    quarter = ', all in one quarter of it' if in_one_half.all() else ''
    if part >= SMALL_IN_PHOTOGRAPH and not quarter:
        return None
    facts = {'share': part, 'width': size[0], 'height': size[1], 'quarter': quarter}
    return Remark.of(KEY, 'small_rig', SMALL, **facts)


def corners_off_the_sand(rig: Rig, pixels: NDArray[np.uint8], reduction: float) -> Remark | None:
    """Return a remark about corners off the edges of the sand, None if none is seen.

    Args:
        rig: the rig with its camera.
        pixels: a decoded photograph without tracer, shape (rows, columns, 3), blue-green-red.
        reduction: ratio of file pixels to decoded pixels.

    Raises:
        InputError: the rig has no camera, or its corners have another order.
    """
    geometry = Geometry.of(rig)
    assert rig.camera is not None  # Geometry.of has checked it
    edges = seen_edges(pixels, geometry, reduction)
    if not edges and _shows_surroundings(geometry, rig.camera, pixels, reduction):
        return Remark.of(
            KEY,
            'corners_off_sand',
            'the photograph shows no edge of the sand near the given corners; look whether they '
            'lie on its corners: ./porotwin check draws them',
        )
    least = LEAST_OFF * max(rig.width_m, rig.height_m)
    told, remedy = [], 'correct them'
    for (name, beside, across), given in zip(CORNERS, rig.camera.corners_px, strict=True):
        inward, down = _at_corner(edges, *beside), _at_corner(edges, *across)
        if max(abs(inward), abs(down)) <= least:
            continue
        x = inward if beside[0] == 'left' else rig.width_m - inward
        z = down if across[0] == 'lower' else rig.height_m - down
        seen = np.array(geometry.to_pixels(np.array(x), np.array(z)))
        apart = float(np.linalg.norm(seen - given))
        unseen = [side for side, _ in (beside, across) if side not in edges]
        if unseen:
            (side,) = {beside[0], across[0]} - {*unseen}
            told.append(
                f'{name} {apart:.0f} px off the {side} edge of the sand, while the {unseen[0]} '
                'edge is not seen'
            )
        else:
            column, row = np.rint(seen).astype(int)
            told.append(f'{name} near [{column}, {row}], {apart:.0f} px from the given one')
        if across[0] == 'upper' and down > least:
            remedy = 'correct them, unless water covers the sand'
    if not told:
        return None
    why = f'the photograph shows other corners of the sand: {"; ".join(told)}'
    return Remark(KEY, '', why, remedy, code='corners_off_sand')


def _shows_surroundings(
    geometry: Geometry, camera: Camera, pixels: NDArray[np.uint8], reduction: float
) -> bool:
    """Return whether the photograph goes on around the described rig."""
    corners, size = np.array(camera.corners_px), reduction * np.array(pixels.shape[1::-1])
    least = FRAME_SHARE * max(geometry.columns, geometry.rows)
    return bool(((corners > least) & (corners < size - least)).all())


def _at_corner(edges: dict[Side, SeenEdge], side: Side, at_end: bool) -> float:
    """Return the distance of an edge from one corner into the rig [m], 0 if it is not seen."""
    edge = edges.get(side)
    if edge is None:
        return 0.0
    return edge.end if at_end else edge.start
