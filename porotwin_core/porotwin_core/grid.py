"""The Cartesian grid of a rig: where its cells lie, and how a map moves to another grid."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError

FloatArray = NDArray[np.floating]


@dataclass(frozen=True)
class Grid:
    """Uniform cells over a rig of `width` x `height` [m]: `nx` columns, `nz` rows.

    Fields are arrays of shape (nz, nx), cell-centred; row 0 is the bottom, column 0 the left.
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
        """Return the grid with every cell split into `factor` x `factor`."""
        return type(self)(self.nx * factor, self.nz * factor, self.width, self.height)

    @classmethod
    def parse(cls, text: str, width: float, height: float) -> Self:
        """Return the grid named on a command line as `187x112` (columns x rows).

        Raises:
            InputError: the text is not two whole numbers joined by an x.
        """
        try:
            nx, nz = (int(part) for part in text.lower().split('x'))
        except ValueError:
            raise InputError(f"grid '{text}': write columns x rows, like 187x112") from None
        return cls(nx, nz, width, height)

    def __str__(self) -> str:
        return f'{self.nx}x{self.nz}'


def _overlap(coarse_or_fine: int, source: int) -> FloatArray:
    """Return the row-stochastic matrix (target, source) of overlaps of two uniform partitions."""
    target_edges = np.linspace(0.0, 1.0, coarse_or_fine + 1)
    source_edges = np.linspace(0.0, 1.0, source + 1)
    low = np.maximum(target_edges[:-1, None], source_edges[None, :-1])
    high = np.minimum(target_edges[1:, None], source_edges[None, 1:])
    return np.maximum(high - low, 0.0) * coarse_or_fine


def conservative_resample(field: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return `field` (nz, nx) averaged over the cells of another grid of the same rig.

    First-order conservative: the integral over the rig is kept to round-off, and the result stays
    within the range of the field. NaN spreads to every cell it touches.
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
    """Return the relative L2 norm of values - reference over the cells known in both.

    NaN when nothing is known, or `reference` is zero: there is nothing to be relative to.
    """
    known = np.isfinite(values) & np.isfinite(reference)
    norm = np.linalg.norm(reference[known])
    return float(np.linalg.norm((values - reference)[known]) / norm) if norm > 0 else float('nan')


def fill_unseen(observed: FloatArray, prediction: FloatArray | None) -> FloatArray:
    """Return the observed map (nz, nx) within 0..1; unseen cells take the `prediction`, or 0.

    What the physics-based model starts from, in the twin and in what COSTA learns from alike.
    """
    substitute = np.zeros_like(observed) if prediction is None else prediction
    return np.where(np.isfinite(observed), np.clip(observed, 0.0, 1.0), substitute)
