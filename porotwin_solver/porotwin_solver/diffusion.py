"""Diffusion and dispersion of the tracer: phi dc/dt = div(phi D grad c), explicit and monotone.

    D = (a_T |v| + D_m) I + (a_L - a_T) v v^T / |v|        v: pore velocity (Scheidegger)

A full tensor on a Cartesian grid makes negative weights in the usual nine-point schemes. Here D is
decomposed, cell by cell, into a sum of exchanges with non-negative weights between cells that may
lie a few columns and rows apart (Selling's formula for obtuse superbases; Fehrenbach and Mirebeau,
J. Math. Imaging Vis. 49 (2014) 123-147). Every exchange takes from one cell what it gives to the
other: linear, symmetric, conservative, second order, and bounded without a limiter. As in
`transport`, every cell steps at its own pace; an exchange goes at that of its faster cell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray
from porotwin_solver.compiled import NO_TAPE
from porotwin_solver.diffusion_kernels import exchange, list_exchanges
from porotwin_solver.flow import FaceField
from porotwin_solver.physics import Physics

LARGEST_SHARE = 0.5
"""Largest share of a cell's volume that it exchanges within one of its steps."""


class Exchanges(NamedTuple):
    """Pairs of cells and the volume that they exchange per time [m^3/s], listed by faster cell.

    Cell k owns the pairs `start[k]:start[k + 1]` with the cells `other` and weights `weight`, and
    takes 2**level[k] steps in `time_step` [s]; `order` and `reach` as in `transport.Pace`.
    """

    time_step: float
    start: NDArray[np.int32]
    other: NDArray[np.int32]
    weight: FloatArray
    level: NDArray[np.int8]
    order: NDArray[np.int32]
    reach: NDArray[np.int64]


def tensor(physics: Physics, flux: FaceField) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return D_xx, D_xz, D_zz [m^2/s] of every cell, (nz, nx), for the flux through its faces."""
    isotropic = physics.diffusion + physics.model_diffusion
    along, across = physics.longitudinal_dispersivity, physics.transverse_dispersivity
    shape = physics.grid.shape
    if not physics.disperses:
        return np.full(shape, isotropic), np.zeros(shape), np.full(shape, isotropic)
    vx, vz, speed = _pore_velocity(physics, flux)
    stretch = (along - across) / speed
    round_part = across * speed + isotropic
    return round_part + stretch * vx * vx, stretch * vx * vz, round_part + stretch * vz * vz


def tensor_adjoint(
    physics: Physics, flux: FaceField, bar: tuple[FloatArray, FloatArray, FloatArray]
) -> FaceField:
    """Return the derivative by the flux of a cost with the derivatives `bar` by the tensor."""
    faces = FaceField.zeros(physics.grid)
    along, across = physics.longitudinal_dispersivity, physics.transverse_dispersivity
    if not physics.disperses:
        return faces
    vx, vz, speed = _pore_velocity(physics, flux)
    xx, xz, zz = bar
    stretch = (along - across) / speed
    turned = (xx * vx * vx + xz * vx * vz + zz * vz * vz) / speed
    by_speed = across * (xx + zz) - stretch * turned
    by_x = by_speed * vx / speed + stretch * (2.0 * xx * vx + xz * vz)
    by_z = by_speed * vz / speed + stretch * (2.0 * zz * vz + xz * vx)
    half = 0.5 / (physics.mobile_water / physics.grid.cell_area)
    by_x *= half / physics.grid.dz
    by_z *= half / physics.grid.dx
    faces.x[:, :-1] += by_x
    faces.x[:, 1:] += by_x
    faces.z[:-1] += by_z
    faces.z[1:] += by_z
    return faces


def _pore_velocity(physics: Physics, flux: FaceField) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the components of the pore velocity and its magnitude [m/s], never quite zero."""
    grid = physics.grid
    pores = physics.mobile_water / grid.cell_area
    vx = 0.5 * (flux.x[:, :-1] + flux.x[:, 1:]) / (grid.dz * pores)
    vz = 0.5 * (flux.z[:-1] + flux.z[1:]) / (grid.dx * pores)
    return vx, vz, np.maximum(np.hypot(vx, vz), 1e-300)


def exchanges(physics: Physics, flux: FaceField, time_step: float) -> Exchanges:
    """Return the exchanges of all cells for the flux through their faces, over `time_step` [s]."""
    grid = physics.grid
    xx, xz, zz = tensor(physics, flux)
    return Exchanges(
        time_step,
        *list_exchanges(
            xx / grid.dx**2,
            xz / (grid.dx * grid.dz),
            zz / grid.dz**2,
            physics.mobile_water,
            physics.storage * (1.0 - physics.immobile_fraction),
            time_step,
            LARGEST_SHARE,
        ),
    )


def diffuse(
    concentration: FloatArray,
    storage: FloatArray,
    pairs: Exchanges,
    *,
    tape: FloatArray | None = None,
) -> None:
    """Advance `concentration` (nz, nx) in place by `pairs.time_step`.

    `storage` (nz, nx) [m^3] is the volume of every cell that holds tracer. `tape` of
    `tape_length(pairs.reach)` records what the adjoint needs.
    """
    exchange(
        concentration.ravel(),
        storage.ravel(),
        pairs.time_step,
        pairs.start,
        pairs.other,
        pairs.weight,
        pairs.level.ravel(),
        pairs.order,
        pairs.reach,
        NO_TAPE if tape is None else tape,
    )
