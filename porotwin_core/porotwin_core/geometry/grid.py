"""The Cartesian grid of a rig, and maps on it: resampling, errors, unseen cells."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError

FloatArray = NDArray[np.floating]
"""An array of floating-point numbers."""

SIZE_TOLERANCE = 1e-4
"""Relative difference of two widths or heights that are the same: 0.1 mm of a metre."""

MOST_SQUARES = 250_000
"""Most squares of a raster, and most cells of a grid, that nobody asked for: a prediction takes a
second or two, a map of a property 2 MB."""

MOST_IN_A_ROW = 10**9
"""Most cells in a row or column: numbers with hundreds of digits have no size of a cell."""


@dataclass(frozen=True)
class Grid:
    """Uniform cells over a rig of `width` x `height` [m]: `nx` columns, `nz` rows.

    Fields are cell-centred arrays of shape (nz, nx). Row 0 is the bottom, column 0 the left.

    Raises:
        InputError: no cells, or a size that is not positive.
    """

    nx: int
    nz: int
    width: float
    height: float

    def __post_init__(self) -> None:
        if self.nx < 1 or self.nz < 1:
            raise InputError(f'grid {self.nx} x {self.nz}: needs at least one cell each way')
        if not (self.width > 0 and self.height > 0):
            raise InputError(f'grid of {self.width} m x {self.height} m: sizes must be positive')

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of a cell field, (nz, nx)."""
        return (self.nz, self.nx)

    @classmethod
    def of_squares(cls, side: float, most: int, width: float, height: float) -> Self:
        """Return squares of `side` [m] over `width` x `height` [m]; larger ones if `most` are less.

        Raises:
            InputError: the rig is far longer than high, or the other way round.
        """
        side = max(side, math.sqrt(width / most * height))
        counts = [max(1.0, size / side) for size in (width, height)]
        check_declared(f'a rig of {width:g} x {height:g} m', counts, most=2 * most, unit='squares')
        columns, rows = (round(count) for count in counts)
        return cls(columns, rows, width, height)

    def covers_the_same(self, other: 'Grid') -> bool:
        """Return whether both grids have the same width and height, within SIZE_TOLERANCE."""
        sizes = (self.width, self.height)
        return bool(np.allclose(sizes, (other.width, other.height), rtol=SIZE_TOLERANCE, atol=0.0))

    @property
    def dx(self) -> float:
        """Cell width [m]."""
        return self.width / self.nx

    @property
    def dz(self) -> float:
        """Cell height [m]."""
        return self.height / self.nz

    @property
    def x(self) -> FloatArray:
        """Cell centres [m], shape (nx,)."""
        return (np.arange(self.nx) + 0.5) * self.dx

    @property
    def z(self) -> FloatArray:
        """Cell centres [m], upward, shape (nz,)."""
        return (np.arange(self.nz) + 0.5) * self.dz

    @property
    def cell_area(self) -> float:
        """Area of a cell in the rig's plane [m^2]."""
        return self.dx * self.dz

    def refined(self, factor: int) -> Self:
        """Return the grid with every cell split into `factor` x `factor` cells."""
        return type(self)(self.nx * factor, self.nz * factor, self.width, self.height)

    @classmethod
    def parse(cls, text: str, width: float, height: float) -> Self:
        """Return the grid written as `187x112` (columns x rows) over `width` x `height` [m].

        Raises:
            InputError: the text is not two whole numbers joined by an x, or there are no cells.
        """
        try:
            nx, nz = (int(part) for part in text.lower().split('x'))
        except ValueError:
            raise InputError(f"grid '{text}': write columns x rows, like 187x112") from None
        if max(nx, nz) > MOST_IN_A_ROW:
            raise InputError(
                f'grid of more than {MOST_IN_A_ROW} cells in a row: take fewer, like 187x112'
            )
        return cls(nx, nz, width, height)

    def __str__(self) -> str:
        """Return `187x112`, the form that `parse` reads."""
        return f'{self.nx}x{self.nz}'


def _overlap(target: int, source: int) -> FloatArray:
    """Return the overlaps of two uniform partitions of a line, (target, source); rows sum to 1."""
    target_edges = np.linspace(0.0, 1.0, target + 1)
    source_edges = np.linspace(0.0, 1.0, source + 1)
    low = np.maximum(target_edges[:-1, None], source_edges[None, :-1])
    high = np.minimum(target_edges[1:, None], source_edges[None, 1:])
    return np.maximum(high - low, 0.0) * target


def conservative_resample(field: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return the averages of `field` (nz, nx) over the cells of another grid of the same rig.

    First-order conservative: the integral over the rig stays the same to round-off, and the result
    stays within the range of the field. A cell that overlaps a NaN becomes NaN.

    Args:
        field: cell averages, (nz, nx).
        shape: (nz, nx) of the result.
    """
    if field.shape == tuple(shape):
        return field.copy()
    rows = _overlap(shape[0], field.shape[0])
    columns = _overlap(shape[1], field.shape[1])
    field = np.asarray(field, dtype=float)
    unknown = np.isnan(field)
    if not unknown.any():
        return rows @ field @ columns.T
    # a product with NaN would spread it along whole rows and columns
    moved = rows @ np.where(unknown, 0.0, field) @ columns.T
    touched = (rows > 0).astype(float) @ unknown @ (columns > 0).T.astype(float) > 0
    return np.where(touched, np.nan, moved)


def relative_error(values: FloatArray, reference: FloatArray) -> float:
    """Return norm(values - reference) / norm(reference), L2 over the cells finite in both (nz, nx).

    NaN if there is no such cell or the reference is zero there.
    """
    known = np.isfinite(values) & np.isfinite(reference)
    norm = np.linalg.norm(reference[known])
    return float(np.linalg.norm((values - reference)[known]) / norm) if norm > 0 else float('nan')


def fill_unseen(observed: FloatArray, prediction: FloatArray | None) -> FloatArray:
    """Return the observed map (nz, nx), clipped to 0..1, with its unseen cells (NaN) filled in.

    Unseen cells take the `prediction`, or 0 without one. The physics-based model starts from this
    map in the live twin, in the training data of COSTA and in its evaluation.
    """
    substitute = np.zeros_like(observed) if prediction is None else prediction
    return np.where(np.isfinite(observed), np.clip(observed, 0.0, 1.0), substitute)
