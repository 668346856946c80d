"""Where the water bodies of a rig touch the sand on one grid: outer faces, and cells of open water.

A body on a part of a side opens the share of each outer face that it covers. The cells of a canal
(open water in the picture) have a given potential. The faces between them and the sand see half a
cell of sand, as outer faces do.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig import SideName, WaterBody
from porotwin_solver.coefficients.face_field import FaceField


class Outline(NamedTuple):
    """One number per outer face: `left` and `right` (nz,), `bottom` and `top` (nx,)."""

    left: FloatArray
    right: FloatArray
    bottom: FloatArray
    top: FloatArray

    @classmethod
    def zeros(cls, grid: Grid) -> 'Outline':
        """Return zeros on every outer face of `grid`."""
        return cls(*(np.zeros(count) for count in (grid.nz, grid.nz, grid.nx, grid.nx)))

    def map(self, change: Callable[..., FloatArray], *others: 'Outline') -> 'Outline':
        """Return `change` of the numbers of each side, here and on the `others`."""
        return Outline(*(change(*sides) for sides in zip(self, *others, strict=True)))


@dataclass(frozen=True, eq=False)
class WaterContact:
    """The water at the sand of one grid. Heads are above `lowest`, the lowest of all [m].

    open: share of each outer face through which a body with a head is in touch [-].
    head: level of that water [m].
    concentration: of the water that enters through an outer face [-].
    rain: water that enters through an outer face at a given rate, or leaves if negative [m^3/s].
    canal: cells of open water, (nz, nx); None without any.
    canal_head, canal_concentration: of these cells [m] and [-], (nz, nx), 0 elsewhere.
    lowest: lowest head [m] above the lower edge of the sand.
    seep: share of each outer face above its level through which water may leave [-].
    diffuses: share of each outer face that lets tracer diffuse [-].
    scale: factors on the transmissibilities [-]; None: 1 everywhere.
    """

    open: Outline
    head: Outline
    concentration: Outline
    rain: Outline
    canal: NDArray[np.bool_] | None
    canal_head: FloatArray
    canal_concentration: FloatArray
    lowest: float
    seep: Outline
    diffuses: Outline
    scale: FaceField | None = None

    @property
    def key(self) -> tuple[bytes, ...]:
        """What the flow depends on, apart from heads and rates."""
        cells = b'' if self.canal is None else self.canal.tobytes()
        scale = b'' if self.scale is None else self.scale.x.tobytes()
        return (*(side.tobytes() for side in self.open), cells, scale)

    @property
    def closed(self) -> bool:
        """Whether no water has a head, so that the wells must balance."""
        return self.canal is None and not any(side.any() for side in self.open)

    @property
    def is_plain(self) -> bool:
        """Whether only pure water enters, through outer faces, so that wells are all sources."""
        beside = (*self.concentration, *self.diffuses)
        return self.canal is None and not any(side.any() for side in beside)

    @property
    def highest(self) -> float:
        """The highest head above the lowest one [m]."""
        return max(float(self.canal_head.max()), *(float(side.max()) for side in self.head))

    @property
    def rainfall(self) -> float:
        """All water that enters or leaves at a given rate [m^3/s]."""
        return float(sum(np.abs(side).sum() for side in self.rain))

    def where_canal(self, values: FloatArray, other: FloatArray) -> FloatArray:
        """Return `other` in the cells of canals and `values` elsewhere, (nz, nx) each."""
        return values if self.canal is None else np.where(self.canal, other, values)

    def potentials(
        self, grid: Grid, weight: float, excess: float
    ) -> tuple[Outline, FloatArray] | None:
        """Return the potential p + rho g z [Pa] at the outer faces and in the canals (nz, nx).

        Water of density rho + `excess` c / g stands at its head H, so that at the height z

            p + rho g z = `weight` H + `excess` c (H - z),

        with `weight` = rho g and `excess` = (rho_stock - rho) g [Pa/m], and the concentration c
        (Bear, Dynamics of Fluids in Porous Media, sec. 9.5). None where it is zero everywhere.
        """
        heights = Outline(grid.z, grid.z, np.zeros(grid.nx), np.full(grid.nx, grid.height))

        def potential(head: FloatArray, c: FloatArray, z: FloatArray) -> FloatArray:
            found: FloatArray = weight * head
            return found + excess * c * (head + self.lowest - z) if excess else found

        outer = self.head.map(potential, self.concentration, heights)
        inner = potential(self.canal_head, self.canal_concentration, grid.z[:, None])
        if not (inner.any() or any(side.any() for side in outer)):
            return None
        return outer, inner if self.canal is None else np.where(self.canal, inner, 0.0)


def contact_of(
    grid: Grid, bodies: Mapping[str, WaterBody], *, blocks: int = 1, seeps: bool = False
) -> WaterContact:
    """Return where `bodies` touch the sand of `grid`; the latest ones are kept.

    Where a side `seeps`, water stands against it up to its level only, and may leave above it.

    Canals and parts of sides consist of whole blocks of `blocks` x `blocks` cells, so that a flux
    on a coarser grid meets the same water.
    """
    return _contact(grid, tuple(bodies.values()), blocks, seeps)


@lru_cache
def _contact(grid: Grid, bodies: tuple[WaterBody, ...], blocks: int, seeps: bool) -> WaterContact:
    if blocks > 1:
        coarse = Grid(grid.nx // blocks, grid.nz // blocks, grid.width, grid.height)
        return _in_blocks(_contact(coarse, bodies, 1, seeps), blocks)
    share, covered, head, stock, rain, seep, diffuses = (Outline.zeros(grid) for _ in range(7))
    canal = np.zeros(grid.shape, dtype=bool)
    canal_head, canal_stock = np.zeros(grid.shape), np.zeros(grid.shape)
    lowest = min((body.head_m for body in bodies if body.head_m is not None), default=0.0)
    for body in bodies:
        level = 0.0 if body.head_m is None else body.head_m - lowest
        if body.side is None:
            cells = canal_cells(grid, body)
            if seeps and body.head_m is not None:  # above its level is air
                cells &= grid.z[:, None] < body.head_m
            canal |= cells
            canal_head[cells], canal_stock[cells] = level, body.concentration
            continue
        cover = side_cover(grid, body.side, body.from_m, body.to_m)
        if body.head_m is None:
            assert body.rate_ml_h is not None
            getattr(rain, body.side)[:] += from_ml_h(body.rate_ml_h) * cover / cover.sum()
        else:
            if seeps and body.side in ('left', 'right'):
                end = min(body.head_m, grid.height if body.to_m is None else body.to_m)
                below = side_cover(grid, body.side, body.from_m, end)
                getattr(seep, body.side)[:] += cover - below
                cover = below
            getattr(share, body.side)[:] += cover
            getattr(head, body.side)[:] += cover * level
        getattr(covered, body.side)[:] += cover
        getattr(stock, body.side)[:] += cover * body.concentration
        getattr(diffuses, body.side)[:] += cover * body.diffuses

    def mean(values: FloatArray, weights: FloatArray) -> FloatArray:
        return np.divide(values, weights, out=np.zeros_like(values), where=weights > 0.0)

    return WaterContact(
        share,
        head.map(mean, share),
        stock.map(mean, covered),
        rain,
        canal if canal.any() else None,
        canal_head,
        canal_stock,
        lowest,
        seep,
        diffuses,
    )


def canal_cells(grid: Grid, body: WaterBody) -> NDArray[np.bool_]:
    """Return the cells (nz, nx) of open water: their centre lies in the polygon of `body`.

    Where it holds no centre, it is the cell that is nearest to the middle of its corners.
    """
    x, z = np.meshgrid(grid.x, grid.z)
    corners = np.array(body.corners_m)
    found = inside(np.column_stack([x.ravel(), z.ravel()]), corners).reshape(grid.shape)
    if not found.any():
        middle = corners.mean(axis=0)
        found.ravel()[np.argmin(np.hypot(x - middle[0], z - middle[1]))] = True
    return found


def side_cover(grid: Grid, side: SideName, low: float, high: float | None) -> FloatArray:
    """Return the share of each face of `side` between `low` and `high` [m]."""
    along_z = side in ('left', 'right')
    count, length = (grid.nz, grid.height) if along_z else (grid.nx, grid.width)
    edges = np.linspace(0.0, length, count + 1)
    end = length if high is None else high
    covered = np.minimum(edges[1:], end) - np.maximum(edges[:-1], low)
    return np.clip(covered * count / length, 0.0, 1.0)


def _in_blocks(contact: WaterContact, blocks: int) -> WaterContact:
    """Return `contact` on the grid with `blocks` x `blocks` cells for each one."""

    def parts(values: FloatArray) -> FloatArray:
        return np.repeat(values, blocks)

    def cells(values: NDArray[np.generic]) -> NDArray[np.generic]:
        return np.repeat(np.repeat(values, blocks, axis=0), blocks, axis=1)

    return WaterContact(
        contact.open.map(parts),
        contact.head.map(parts),
        contact.concentration.map(parts),
        contact.rain.map(lambda values: parts(values) / blocks),
        None if contact.canal is None else cells(contact.canal),  # type: ignore[arg-type]
        cells(contact.canal_head),  # type: ignore[arg-type]
        cells(contact.canal_concentration),  # type: ignore[arg-type]
        contact.lowest,
        contact.seep.map(parts),
        contact.diffuses.map(parts),
    )


def outer_flux(into: Outline) -> FaceField:
    """Return the flux [m^3/s] of water that goes `into` the rig [m^3/s] through its outer faces."""
    nz, nx = len(into.left), len(into.top)
    flux = FaceField(np.zeros((nz, nx + 1)), np.zeros((nz + 1, nx)))
    flux.x[:, 0], flux.x[:, -1] = into.left, -into.right
    flux.z[0], flux.z[-1] = into.bottom, -into.top
    return flux


def entering(flux: FaceField) -> Outline:
    """Return the flux [m^3/s] into the rig through its outer faces; negative where it leaves."""
    return Outline(flux.x[:, 0], -flux.x[:, -1], flux.z[0], -flux.z[-1])
