"""Diffusion and dispersion of the tracer: phi dc/dt = div(phi D grad c), explicit and monotone.

    D = (a_T |v| + D_m) I + (a_L - a_T) v v^T / |v|        v: pore velocity (Scheidegger)

(Bear, Dynamics of Fluids in Porous Media, sec. 10.4.) The usual nine-point schemes for a full
tensor on a Cartesian grid have negative weights. Here D is decomposed, cell by cell, into exchanges
with non-negative weights between cells that may lie several columns and rows apart: Selling's
formula for obtuse superbases (Fehrenbach and Mirebeau, J. Math. Imaging Vis. 49 (2014) 123-147).
Each exchange adds to one cell the amount that it takes from the other. The scheme is linear,
symmetric, conservative, second order, and bounded without a limiter. The cells take local time
steps as in `transport`; an exchange runs at the level of its faster cell.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray
from porotwin_solver.cell_threads import BLOCK_CELLS, THREADED_CELLS, side_by_side
from porotwin_solver.diffusion_kernels import (
    add_gains,
    exchange,
    exchange_once,
    farthest_pair,
    pair_cells,
)
from porotwin_solver.face_field import FaceField
from porotwin_solver.local_time_steps import NO_TAPE, TimeStepLevels
from porotwin_solver.physics import Physics

EXCHANGE_LIMIT = 0.5
"""Largest fraction of its storage [-] that a cell exchanges in one substep; monotone up to 1."""

LEAST_SPEED = 1e-300
"""Speed [m/s] that replaces zero, so that the direction v / |v| of still water is finite."""


class DispersionTensor(NamedTuple):
    """The symmetric tensor D of every cell; `xx`, `xz` and `zz` are (nz, nx) [m^2/s] each."""

    xx: FloatArray
    xz: FloatArray
    zz: FloatArray


class Exchanges(NamedTuple):
    """Pairs of cells and the volume that they exchange per time, listed by faster cell.

    levels: local time step levels for this exchange.
    start: (nz * nx + 1,); cell k owns the pairs start[k] to start[k + 1] - 1.
    other: (pairs,); flat index of the other cell.
    weight: (pairs,) [m^3/s]; exchanged volume.
    """

    levels: TimeStepLevels
    start: NDArray[np.int32]
    other: NDArray[np.int32]
    weight: FloatArray


def dispersion_tensor(physics: Physics, flux: FaceField) -> DispersionTensor:
    """Return D of every cell for the water flux [m^3/s] through its faces.

    Scheidegger's tensor D = (D_m + a_T |v|) I + (a_L - a_T) v v^T / |v| with the pore velocity v
    (Bear 1972, sec. 10.4).
    """
    isotropic = physics.diffusion + physics.model_diffusion
    along, across = physics.longitudinal_dispersivity, physics.transverse_dispersivity
    shape = physics.grid.shape
    if not physics.disperses:
        return DispersionTensor(
            np.full(shape, isotropic), np.zeros(shape), np.full(shape, isotropic)
        )
    vx, vz, speed = _pore_velocity(physics, flux)
    stretch = (along - across) / speed
    round_part = across * speed + isotropic
    return DispersionTensor(
        round_part + stretch * vx * vx, stretch * vx * vz, round_part + stretch * vz * vz
    )


def dispersion_tensor_adjoint(
    physics: Physics, flux: FaceField, bar: DispersionTensor
) -> FaceField:
    """Return dJ/dflux of a cost J with the derivatives `bar` = dJ/dD."""
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
    """Return v_x, v_z and |v| [m/s] in the cells, (nz, nx) each; |v| is positive."""
    grid = physics.grid
    pores = physics.mobile_water / grid.cell_area
    vx = 0.5 * (flux.x[:, :-1] + flux.x[:, 1:]) / (grid.dz * pores)
    vz = 0.5 * (flux.z[:-1] + flux.z[1:]) / (grid.dx * pores)
    return vx, vz, np.maximum(np.hypot(vx, vz), LEAST_SPEED)


def dispersive_exchanges(physics: Physics, flux: FaceField, duration: float) -> Exchanges:
    """Return the exchanges of all cells for the water flux [m^3/s], over `duration` [s]."""
    level, order, count_at_least, start, other, weight = pair_cells(
        _per_cell_size(dispersion_tensor(physics, flux), physics),
        physics.mobile_water,
        physics.storage * (1.0 - physics.immobile_fraction),
        duration,
        EXCHANGE_LIMIT,
    )
    levels = TimeStepLevels(duration, level, order, count_at_least)
    return Exchanges(levels, start, other, weight)


def _per_cell_size(tensor: DispersionTensor, physics: Physics) -> DispersionTensor:
    """Return the components divided by the squared cell sizes [1/s]: D in units of cells."""
    grid = physics.grid
    return DispersionTensor(
        tensor.xx / grid.dx**2, tensor.xz / (grid.dx * grid.dz), tensor.zz / grid.dz**2
    )


def diffuse(
    concentration: FloatArray,
    storage: FloatArray,
    exchanges: Exchanges,
    *,
    tape: FloatArray = NO_TAPE,
) -> None:
    """Advance `concentration` (nz, nx) in place by `exchanges.levels.duration`.

    `storage` (nz, nx) [m^3] is the volume of every cell that stores tracer. `tape`, of length
    `tape_length(exchanges.levels)`, records the values that the adjoint needs. Threads share the
    cells of a large grid if all of them take the same step, unless a tape is recorded.
    """
    c, volume = concentration.ravel(), storage.ravel()
    if len(tape) or c.size < THREADED_CELLS or len(exchanges.levels.count_at_least) > 1:
        exchange(c, volume, exchanges, tape)
        return
    gain = np.zeros(c.size)
    # a strip reaches into its neighbours; every second one can be worked on at the same time
    strip = max(BLOCK_CELLS, 2 * farthest_pair(exchanges))
    strips = [(start, min(start + strip, c.size)) for start in range(0, c.size, strip)]
    for chosen in (strips[::2], strips[1::2]):
        side_by_side(exchange_once, [(c, gain, exchanges, *ends) for ends in chosen])
    side_by_side(add_gains, [(c, gain, volume, *ends) for ends in strips])
