"""Where the sand ends in a photograph, near the edges that `camera.corners_px` describes.

The ground beyond the edge of a rig, a frame, a board or a wall, looks like nothing inside the rig:
it has another colour, or no grains. So the edge is the line where foreign ground ends. Each side of
the described rig is searched for this line, in a strip along it. The line may lean, because one
corner may be wrong alone. It may bow, because terms of the curvature may be missing.

A first search takes fine steps and looks near the described edge. A second one takes coarse steps
and looks farther away, for the sides that the first one did not find within its reach.
"""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from porotwin_imaging.baseline.baseline_mask import texture
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.photograph.linear_light import linear_light

Array = NDArray[Any]
Side = Literal['upper', 'lower', 'left', 'right']

NEAR_STEPS, FAR_STEPS = 1000, 400
"""Steps of both searches along the longer side of the rig."""
_REACH = 50
"""Half the width of a strip: an edge farther from its described place is not found [steps]."""
_FAR = 16
"""Least distance from its described place of an edge that only the second search finds [steps]: the
first one would have seen a nearer one."""
_WINDOW = 5
"""Ground is judged over this distance across an edge [steps]."""
PARTS = 24
"""Parts along a side; the ground of each is judged alone."""
_LEANS, _BOWS = np.arange(-45, 46, 2), np.arange(-24, 25, 4)
"""Distances of both ends from the described edge, and of the middle from the line between the ends,
that are tried [steps]."""
_TILE = 10
"""Points of the rig, each way, that are one sample of the ground inside it."""
_LEAST_LIGHT, _LEAST_TEXTURE = 4e-3, 1e-2
"""Light and texture are raised by this before their logarithms are taken."""
_UNITS = np.array([0.25, 0.06, 0.06, 0.35], np.float32)
"""Differences in the logarithms of light, of two ratios of colours, and of texture that are one
step of foreignness."""
_SHADES = np.linspace(0.0, 1.4, 6)
"""Logarithms of shadows that the frame casts on the sand: ground that is only darker is not
foreign."""
LAYERED: tuple[Side, ...] = ('upper', 'lower')
"""Sides along which water or a layer of another sand may lie inside the rig."""
_MOST_FOREIGN = 6.0
"""More foreign ground counts as this, so that one bright bolt does not decide about a line."""
_LEAST_DROP, _LEAST_PARTS = 2.0, 0.7
"""Least change across an edge in steps of foreignness, and the share of the parts that must show
it."""


@dataclass(frozen=True)
class SeenEdge:
    """The edge of the sand along one side of the rig.

    Attributes:
        side: the side of the rig.
        start: distance [m] of the edge from the described one where x or z is 0, into the rig;
            negative if the sand goes on beyond the described edge.
        end: the same at the other end of the side.
    """

    side: Side
    start: float
    end: float

    @property
    def distance(self) -> float:
        """Largest distance [m] of an end from the described edge."""
        return max(abs(self.start), abs(self.end))


def seen_edges(
    pixels: NDArray[np.uint8], geometry: Geometry, reduction: float
) -> dict[Side, SeenEdge]:
    """Return the edges of the sand that the photograph shows, by side.

    Args:
        pixels: the decoded photograph, shape (rows, columns, 3).
        geometry: the described place of the rig in the photograph.
        reduction: ratio of file pixels to decoded pixels.
    """
    longer = max(geometry.width, geometry.height)
    near = _edges(pixels, geometry, reduction, NEAR_STEPS)
    reach, least = _LEANS.max() * longer / NEAR_STEPS, _FAR * longer / FAR_STEPS
    sure = {side: edge for side, edge in near.items() if edge.distance < reach}
    if len(sure) == len(get_args(Side)):
        return sure
    far = _edges(pixels, geometry, reduction, FAR_STEPS)
    beyond = {side: edge for side, edge in far.items() if edge.distance > least}
    return near | beyond | sure


def _edges(
    pixels: NDArray[np.uint8], geometry: Geometry, reduction: float, steps: int
) -> dict[Side, SeenEdge]:
    """Return the edges of the sand by side, searched in `steps` along the longer side."""
    step = max(geometry.width, geometry.height) / steps
    look = _look(pixels, geometry, reduction, steps)
    inside = _inside(look, step)
    if inside is None:
        return {}
    found = (_edge(side, look, inside, step) for side in get_args(Side))
    return {edge.side: edge for edge in found if edge is not None}


@dataclass(frozen=True)
class _Look:
    """The appearance of a part of a photograph, to be read at places of the rig.

    Attributes:
        appearance: the part, shape (rows, columns, 4).
        geometry: the described place of the rig in the photograph.
        first: column and row of the photograph where the part begins [px of the file].
        reduction: ratio of file pixels to pixels of the part.
    """

    appearance: Array
    geometry: Geometry
    first: tuple[float, float]
    reduction: float

    def at(self, x: Array, z: Array) -> Array:
        """Return the appearance (..., 4) at points [m], NaN outside the photograph."""
        columns, rows = (
            ((place + 0.5 - first) / self.reduction - 0.5).astype(np.float32)
            for place, first in zip(self.geometry.to_pixels(x, z), self.first, strict=True)
        )
        return cv2.remap(
            self.appearance, columns, rows, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan,) * 4,
        )  # fmt: skip


def _look(pixels: NDArray[np.uint8], geometry: Geometry, reduction: float, steps: int) -> _Look:
    """Return the photograph around the rig with at most one pixel per step."""
    across = max(geometry.columns, geometry.rows)
    margin = 2 * _REACH / steps * across
    x, z = np.meshgrid([0.0, geometry.width], [0.0, geometry.height])
    corners = np.stack(geometry.to_pixels(x, z))
    parts = []
    for places, size in zip(corners, pixels.shape[1::-1], strict=True):
        low = min(max(0, int((places.min() - margin) / reduction)), size - 1)
        parts.append(slice(low, max(low, int((places.max() + margin) / reduction)) + 1))
    around = pixels[parts[1], parts[0]]
    scale = min(1.0, steps * reduction / across)
    scale = max(scale, 1.0 / min(around.shape[:2]))  # at least one pixel is left
    small = cv2.resize(around, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    appearance = _appearance(linear_light(np.asarray(small, np.uint8)))
    first = parts[0].start * reduction, parts[1].start * reduction
    return _Look(appearance, geometry, first, reduction / scale)


def _appearance(light: Array) -> Array:
    """Return logarithms of light, of two ratios of colours and of texture, (rows, columns, 4)."""
    red, green, blue = np.moveaxis(np.log(light + _LEAST_LIGHT), -1, 0)
    grains = np.log(texture(light) + _LEAST_TEXTURE)
    mean = (red + green + blue) / 3
    return np.stack([mean, red - green, blue - green, grains], axis=-1).astype(np.float32)


def _inside(look: _Look, step: float) -> cKDTree | None:
    """Return the appearance of places well inside the rig, lit and in shadow, in `_UNITS`.

    None if the rig is too small for such places.
    """
    sides = look.geometry.width, look.geometry.height
    x, z = (np.arange(_REACH * step, side - _REACH * step, 2 * step) for side in sides)
    if min(x.size, z.size) < _TILE:
        return None
    size = (x.size // _TILE, z.size // _TILE)
    seen = cv2.resize(look.at(*np.meshgrid(x, z)), size, interpolation=cv2.INTER_AREA)
    lit = seen[np.isfinite(seen).all(axis=-1)]
    shades = [lit - [shade, 0.0, 0.0, 0.0] for shade in _SHADES]
    return cKDTree(np.concatenate(shades) / _UNITS) if lit.size else None


def _edge(side: Side, look: _Look, inside: cKDTree, step: float) -> SeenEdge | None:
    """Return the edge of one side; None if the photograph does not show it clearly.

    Foreign ground inside the upper or the lower edge may belong to the rig: water above the sand,
    or a layer of another sand. It does if the described edge is seen too. Neither of them ends at a
    corner of the rig: there, one corner alone is wrong.
    """
    ground, places = _ground(side, look, step)
    if not places.size:
        return None
    foreign = np.minimum(_foreignness(ground, inside), _MOST_FOREIGN)
    drop = np.full(foreign.shape, -_MOST_FOREIGN)  # where the photograph ends, there is no edge
    drop[_WINDOW:] = np.nan_to_num(foreign[:-_WINDOW] - foreign[_WINDOW:], nan=-_MOST_FOREIGN)
    start, end, rows = _line(drop, places)
    if (drop[rows, np.arange(PARTS)] > _LEAST_DROP).mean() < _LEAST_PARTS:
        return None
    layered = side in LAYERED and min(abs(start), abs(end)) > 2 * _WINDOW
    if layered and _has_rim(ground, rows):
        return None
    return SeenEdge(side, start * step, end * step)


def _has_rim(ground: Array, rows: NDArray[np.intp]) -> bool:
    """Return whether the described edge may be a rim beyond ground that ends at `rows`.

    A rim, the end of water or of a layer, is seen within two windows of the described edge, or
    hidden where the photograph ends.
    """
    rim = 2 * _WINDOW
    changes = np.linalg.norm((ground[_WINDOW:] - ground[:-_WINDOW]) / _UNITS, axis=-1)
    changes = np.nan_to_num(changes, nan=np.inf)
    first = _REACH - rim - _WINDOW
    lasts = np.minimum(_REACH + rim, rows - rim) - _WINDOW
    strongest = [
        changes[first:last, part].max() for part, last in enumerate(lasts) if last > first + rim
    ]
    return bool(strongest) and float(np.median(strongest)) > _LEAST_DROP


def _ground(side: Side, look: _Look, step: float) -> tuple[Array, Array]:
    """Return the appearance across one side, and the places of its parts along it.

    The appearance, shape (2 * _REACH + 1, PARTS, 4), is the mean over the `_WINDOW` steps that
    follow each distance from the described edge into the rig. The places, shape (PARTS,), count
    from 0 to 1; there are none along a side that is too short.
    """
    width, height = look.geometry.width, look.geometry.height
    length = width if side in ('upper', 'lower') else height
    along = np.arange(_REACH * step, length - _REACH * step, step)
    if along.size < 2 * _REACH:  # shorter than the strip is wide
        return np.empty((0, 0, 4)), np.empty(0)
    across = np.arange(-_REACH, _REACH + _WINDOW) * step
    depth, place = np.meshgrid(across, along, indexing='ij')
    x, z = {
        'upper': (place, height - depth),
        'lower': (place, depth),
        'left': (depth, place),
        'right': (width - depth, place),
    }[side]
    parts = np.array_split(look.at(x, z), PARTS, axis=1)
    middle = np.stack([np.median(part, axis=1) for part in parts], axis=1)
    windows = sliding_window_view(middle, _WINDOW, axis=0).mean(axis=-1)
    places = np.array([part.mean() for part in np.array_split(along, PARTS)]) / length
    return windows, places


def _foreignness(ground: Array, inside: cKDTree) -> Array:
    """Return the distance of `ground` (..., 4) to the most similar place inside; NaN stays NaN."""
    known = np.isfinite(ground).all(axis=-1)
    foreign = np.full(known.shape, np.nan)
    foreign[known] = inside.query(ground[known] / _UNITS)[0]
    return foreign


def _line(drop: Array, places: Array) -> tuple[int, int, NDArray[np.intp]]:
    """Return start and end [steps] of the line with the largest sum of drops, and its rows."""
    start, end = (ends[..., None] for ends in np.meshgrid(_LEANS, _LEANS, indexing='ij'))
    best, found = -np.inf, (0, 0, np.zeros(PARTS, np.intp))
    straight = start * (1 - places) + end * places
    for bow in _BOWS:
        lines = straight + 4 * bow * places * (1 - places)
        rows = np.clip(np.rint(lines).astype(np.intp) + _REACH, 0, len(drop) - 1)
        sums = drop[rows, np.arange(PARTS)].sum(axis=-1)
        at = np.unravel_index(int(sums.argmax()), sums.shape)
        if sums[at] > best:
            best = float(sums[at])
            found = int(_LEANS[at[0]]), int(_LEANS[at[1]]), rows[at]
    return found
