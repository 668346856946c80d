"""The virtual rig's own mesh: bilinear elements, with the unknowns at their vertices."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig

FloatArray = NDArray[np.floating]

DEFAULT_VERTICES = 120_000
"""Vertices of a default mesh; they are 2.1 mm apart on the paper's small rig."""

MOST_VERTICES = 480_000
"""Vertices of the finest mesh for sands with interfaces; 3 mm apart on the large rig."""

PER_SAND_CELL = 3.0
"""Elements per cell of the permeability map, each way. An element takes the sand at its middle,
which shifts an interface by up to half an element."""

ON_FACE = 1e-6
"""Distance from a face, in elements, at which a place counts as on the face."""

OFF_FACE = 1e-4
"""Distance by which such a place is moved, in elements; far below the error of the mesh."""


@dataclass(frozen=True)
class Mesh:
    """Rectangular elements over the rig.

    Vertex fields have shape (nz + 1, nx + 1), element fields (nz, nx); row 0 is the bottom. Every
    vertex has a box bounded by the middles of the elements; along a wall it is half as wide.

    Args:
        nx: number of elements along x.
        nz: number of elements along z.
        width: width of the rig [m].
        height: height of the rig [m].
    """

    nx: int
    nz: int
    width: float
    height: float

    @classmethod
    def over(cls, rig: Rig, *, cell: float | None = None) -> Self:
        """Return a mesh of nearly square elements over `rig`.

        Numbers of elements are odd, so the mesh is not a multiple of the grid of a model.

        Args:
            rig: the rig.
            cell: approximate size of an element [m]; None: it follows from the sands.
        """
        cell = cell or _default_cell(rig)
        nx, nz = (max(9, 2 * round(size / cell / 2) + 1) for size in (rig.width_m, rig.height_m))
        return cls(nx, nz, rig.width_m, rig.height_m)

    @property
    def hx(self) -> float:
        """Element width [m]."""
        return self.width / self.nx

    @property
    def hz(self) -> float:
        """Element height [m]."""
        return self.height / self.nz

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a vertex field, (nz + 1, nx + 1)."""
        return (self.nz + 1, self.nx + 1)

    @property
    def x(self) -> FloatArray:
        """Vertex positions [m], shape (nx + 1,)."""
        return np.arange(self.nx + 1) * self.hx

    @property
    def z(self) -> FloatArray:
        """Vertex heights [m], shape (nz + 1,)."""
        return np.arange(self.nz + 1) * self.hz

    @property
    def elements(self) -> Grid:
        """The elements as a cell-centred grid, shape (nz, nx)."""
        return Grid(self.nx, self.nz, self.width, self.height)

    @property
    def box_width(self) -> FloatArray:
        """Widths of the vertices' boxes [m], shape (nx + 1,)."""
        return np.diff(box_edges(self.nx, self.width))

    @property
    def box_height(self) -> FloatArray:
        """Heights of the vertices' boxes [m], shape (nz + 1,)."""
        return np.diff(box_edges(self.nz, self.height))

    @property
    def box_area(self) -> FloatArray:
        """Areas of the vertices' boxes [m^2], shape (nz + 1, nx + 1)."""
        return np.outer(self.box_height, self.box_width)

    def off_faces(self, x: float, z: float) -> tuple[float, float]:
        """Return the place (x, z) [m]; a place on a face is moved into one box.

        On a face, round-off would decide which box holds a well. The middle of every rig is on a
        face, because the numbers of elements are odd.
        """
        return _off_edges(x, self.hx), _off_edges(z, self.hz)

    def to_vertices(self, field: FloatArray) -> FloatArray:
        """Return the mean of a map over the box of each vertex, (nz + 1, nx + 1).

        The map may have any uniform grid over the rig, of any shape (rows, columns).
        """
        rows = _overlap(box_edges(self.nz, 1.0), np.linspace(0.0, 1.0, field.shape[0] + 1))
        columns = _overlap(box_edges(self.nx, 1.0), np.linspace(0.0, 1.0, field.shape[1] + 1))
        return rows @ field @ columns.T

    def to_grid(self, field: FloatArray, weight: FloatArray, grid: Grid) -> FloatArray:
        """Return the weighted mean of `field` over the cells of `grid`, (nz, nx).

        With porosity times depth as the weight the mass of the tracer is kept to round-off:
        sum(result * weight of the cells) = sum(field * weight * box area).

        Args:
            field: values at the vertices, (nz + 1, nx + 1).
            weight: positive weights, same shape.
            grid: the target grid.
        """
        rows = _overlap(np.linspace(0.0, 1.0, grid.nz + 1), box_edges(self.nz, 1.0))
        columns = _overlap(np.linspace(0.0, 1.0, grid.nx + 1), box_edges(self.nx, 1.0))
        return (rows @ (field * weight) @ columns.T) / (rows @ weight @ columns.T)


def _default_cell(rig: Rig) -> float:
    """Return the default size of elements [m]: smaller than the cells of the permeability map."""
    area = rig.width_m * rig.height_m
    cell = math.sqrt(area / DEFAULT_VERTICES)
    permeability = rig.nominal_map('permeability_m2')
    if isinstance(permeability, float):
        return cell
    interfaces = rig.width_m / permeability.shape[1] / PER_SAND_CELL
    return max(min(cell, interfaces), math.sqrt(area / MOST_VERTICES))


def _off_edges(place: float, size: float) -> float:
    from_vertex = place / size
    on_edge = abs(from_vertex - math.floor(from_vertex) - 0.5) < ON_FACE
    return place + OFF_FACE * size if on_edge else place


def box_edges(elements: int, length: float) -> FloatArray:
    """Return the edges of the boxes along a side, in the unit of its `length`, (elements + 2,)."""
    inner = (np.arange(elements) + 0.5) * (length / elements)
    return np.concatenate(([0.0], inner, [length]))


def _overlap(target: FloatArray, source: FloatArray) -> FloatArray:
    """Return the overlaps of two partitions, given by their edges, as a row-stochastic matrix."""
    low = np.maximum(target[:-1, None], source[None, :-1])
    high = np.minimum(target[1:, None], source[None, 1:])
    return np.maximum(high - low, 0.0) / np.diff(target)[:, None]
