"""Where water stands or falls at the sand of the virtual rig: vertices of its mesh."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.polygons import inside
from porotwin_core.rig import WaterBody
from porotwin_rig.box_flow import Fluxes, no_flux
from porotwin_rig.mesh import Mesh

FloatArray = NDArray[np.floating]

NO_WATER = -1.0
"""Concentration where no water can enter."""


@dataclass(frozen=True, eq=False)
class WaterPlaces:
    """The water at the sand; every array is over the vertices, (nz + 1, nx + 1).

    Args:
        held: vertices at the potential of some water.
        canal: those of open water in the picture.
        head: level of that water above the lowest one [m], 0 elsewhere.
        level: level above the lower edge of the sand [m], 0 elsewhere.
        entering: concentration of the water that may enter here [-]; NO_WATER where none can.
        fixed: vertices that keep this concentration: canals, and walls through which it diffuses.
        rain: water that enters at given rates, through the walls.
        lowest: the lowest level [m] above the lower edge of the sand.
    """

    held: NDArray[np.bool_]
    canal: NDArray[np.bool_]
    head: FloatArray
    level: FloatArray
    entering: FloatArray
    fixed: NDArray[np.bool_]
    rain: Fluxes
    lowest: float

    @classmethod
    def on(cls, mesh: Mesh, bodies: Mapping[str, WaterBody]) -> Self:
        """Return the places of `bodies` on `mesh`. Where two meet, the upper or lower one wins."""
        held, canal, fixed = (np.zeros(mesh.shape, dtype=bool) for _ in range(3))
        head, level = np.zeros(mesh.shape), np.zeros(mesh.shape)
        entering, rain = np.full(mesh.shape, NO_WATER), no_flux(mesh)
        heads = [body.head_m for body in bodies.values() if body.head_m is not None]
        for body in sorted(bodies.values(), key=lambda body: body.side in ('top', 'bottom')):
            where = _inside(mesh, body) if body.side is None else _beside(mesh, body)
            entering[where] = body.concentration
            if body.diffuses:
                fixed |= where
            if body.head_m is None:
                _let_fall(rain, mesh, body, where)
                continue
            held |= where
            head[where], level[where] = body.head_m - min(heads), body.head_m
            if body.side is None:
                canal |= where
        lowest = min(heads, default=0.0)
        return cls(held, canal, head, level, entering, fixed | canal, rain, lowest)

    def potential(self, z: FloatArray, excess: float) -> FloatArray | None:
        """Return the potential of the held vertices [m of water]; None if it is 0 everywhere.

        Water that is denser by the share `excess` at the concentration 1 stands at its level H, so
        that it has H + excess c (H - z) at the height z (1, nz + 1) (Bear 1972, sec. 9.5).
        """
        dense = excess * np.maximum(self.entering, 0.0) * (self.level - z)
        found = np.where(self.held, self.head + dense, 0.0)
        return found if found.any() else None


def _wall(side: str) -> tuple[slice | int, slice | int]:
    walls: dict[str, tuple[slice | int, slice | int]] = {
        'left': (slice(None), 0),
        'right': (slice(None), -1),
        'bottom': (0, slice(None)),
        'top': (-1, slice(None)),
    }
    return walls[side]


def _beside(mesh: Mesh, body: WaterBody) -> NDArray[np.bool_]:
    """Return the vertices of a part of a side; the nearest one if it holds none."""
    assert body.side is not None
    along = mesh.z if body.side in ('left', 'right') else mesh.x
    end = along[-1] if body.to_m is None else body.to_m
    slip = 1e-9 * along[-1]
    chosen = (along >= body.from_m - slip) & (along <= end + slip)
    if not chosen.any():
        chosen[np.argmin(np.abs(along - 0.5 * (body.from_m + end)))] = True
    found = np.zeros(mesh.shape, dtype=bool)
    found[_wall(body.side)] = chosen
    return found


def _inside(mesh: Mesh, body: WaterBody) -> NDArray[np.bool_]:
    """Return the vertices in a polygon; the nearest one to its middle if it holds none."""
    corners = np.array(body.corners_m)
    x, z = np.meshgrid(mesh.x, mesh.z)
    found = inside(np.column_stack([x.ravel(), z.ravel()]), corners)
    if not found.any():
        middle = corners.mean(axis=0)
        found[np.argmin(np.hypot(x - middle[0], z - middle[1]))] = True
    return found.reshape(mesh.shape)


def _let_fall(rain: Fluxes, mesh: Mesh, body: WaterBody, where: NDArray[np.bool_]) -> None:
    """Add the water of `body` to the fluxes through the wall, evenly over its vertices."""
    assert body.side is not None
    assert body.rate_ml_h is not None
    width = mesh.box_height if body.side in ('left', 'right') else mesh.box_width
    share = width * where[_wall(body.side)]
    inward = from_ml_h(body.rate_ml_h) * share / share.sum()
    wall = rain.x if body.side in ('left', 'right') else rain.z
    wall[_wall(body.side)] += inward if body.side in ('left', 'bottom') else -inward
