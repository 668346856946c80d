"""Diffusion and dispersion of the tracer: phi dc/dt = div(phi D grad c), explicit and monotone.

    D = (a_T |v| + D_m) I + (a_L - a_T) v v^T / |v|        v: pore velocity (Scheidegger)

(Bear, Dynamics of Fluids in Porous Media, sec. 10.4.) The usual nine-point schemes for a full
tensor on a Cartesian grid have negative weights. Here D is decomposed, cell by cell, into exchanges
with non-negative weights between cells that may lie several columns and rows apart: Selling's
formula for obtuse superbases (Fehrenbach and Mirebeau, J. Math. Imaging Vis. 49 (2014) 123-147).
Each exchange adds to one cell the amount that it takes from the other. The scheme is linear,
symmetric, conservative, second order, and bounded without a limiter. The cells take local time
steps as in `transport`; an exchange runs at the level of its faster cell. Where that asks for many
substeps, the exchange is implicit along lines of cells (`line_kernels`).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.cell_threads import in_rows
from porotwin_solver.coefficients.compiled import NEGLIGIBLE
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.transport.diffusion_kernels import (
    add_gains,
    ends_of_tracer,
    exchange,
    gains_from_neighbours,
    named_pairs,
    neighbour_pairs,
    sort_pairs,
)
from porotwin_solver.transport.line_kernels import Lines, exchange_along_lines, make_lines
from porotwin_solver.transport.local_time_steps import (
    HIGHEST_LEVEL,
    NO_TAPE,
    TimeStepLevels,
    assign_levels,
    tape_length,
)

EXCHANGE_LIMIT = 0.5
"""Largest fraction of its storage [-] that a cell exchanges in one substep; monotone up to 1."""


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
    to_neighbours: whether every cell owns the pairs with its upper and its right neighbour, in this
        order, and all cells take one step.
    lines: the cells on lines where the exchange is implicit; all levels are then zero.
    """

    levels: TimeStepLevels
    start: NDArray[np.int32]
    other: NDArray[np.int32]
    weight: FloatArray
    to_neighbours: bool = False
    lines: Lines | None = None

    @property
    def tape_length(self) -> int:
        """The number of updates of all cells together: the length of the tape of `diffuse`."""
        if self.lines is None:
            return tape_length(self.levels)
        return self.lines.steps * len(self.lines.cell)


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
    return (
        vx,
        vz,
        np.maximum(np.hypot(vx, vz), np.finfo(float).tiny),
    )  # the direction of still water is finite


def dispersive_exchanges(physics: Physics, flux: FaceField, duration: float) -> Exchanges:
    """Return the exchanges of all cells for the water flux [m^3/s], over `duration` [s]."""
    if not physics.disperses:
        found = _neighbour_exchanges(physics, duration)
        if found is not None:
            return found
    size = physics.mobile_water.size
    storage = (physics.storage * (1.0 - physics.immobile_fraction)).ravel()
    tensor = _per_cell_size(dispersion_tensor(physics, flux), physics)
    stride, ahead, behind, volume, total = named_pairs(tensor, physics.mobile_water)
    rate = total / storage
    level = np.empty(physics.grid.shape, np.int8)
    order, count_at_least = assign_levels(rate, duration, EXCHANGE_LIMIT, level.ravel())
    levels = TimeStepLevels(duration, level, order, count_at_least)
    # as advection, the substeps grow with the inverse of the cell size; in pairs of either order
    exchanged = min(2.0**HIGHEST_LEVEL, float(np.mean(rate)) * duration)
    steps = 2 * max(1, math.ceil(0.5 * math.sqrt(exchanged)))
    # a substep along lines takes as long as four of `exchange`
    implicit = 4 * steps * size < tape_length(levels)
    if implicit:
        level = np.zeros_like(level)
        order = np.arange(size, dtype=np.int32)
        levels = TimeStepLevels(duration, level, order, np.array([size]))
    start, other, weight = sort_pairs(stride, ahead, behind, volume, level.ravel())
    lines = None
    if implicit:
        lines = Lines(steps, *make_lines(start, other, weight, storage, duration / steps))
    return Exchanges(levels, start, other, weight, lines=lines)


def _neighbour_exchanges(physics: Physics, duration: float) -> Exchanges | None:
    """Return the exchanges of the same diffusion everywhere; None if a cell needs several steps."""
    grid, water = physics.grid, physics.mobile_water
    diffusion = physics.diffusion + physics.model_diffusion
    start, other, weight, total = neighbour_pairs(
        diffusion / grid.dx**2, diffusion / grid.dz**2, water
    )
    storage = physics.storage * (1.0 - physics.immobile_fraction)
    if diffusion == 0.0 or float(np.max(total / storage)) * duration > EXCHANGE_LIMIT:
        return None
    order = np.arange(water.size, dtype=np.int32)
    level = np.zeros(grid.shape, np.int8)
    levels = TimeStepLevels(duration, level, order, np.array([water.size]))
    return Exchanges(levels, start, other, weight, to_neighbours=True)


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
    negligible: float = NEGLIGIBLE,
) -> None:
    """Advance `concentration` (nz, nx) in place by `exchanges.levels.duration`.

    `storage` (nz, nx) [m^3] is the volume of every cell that stores tracer. `tape`, of length
    `exchanges.tape_length`, records the values that the adjoint needs. Threads share the cells of a
    large grid where neighbours alone exchange; a difference up to `negligible` [-] moves nothing
    there.
    """
    if exchanges.lines is not None:
        exchange_along_lines(concentration.ravel(), storage.ravel(), exchanges.lines, tape)
        return
    if len(tape) or not exchanges.to_neighbours:
        exchange(concentration.ravel(), storage.ravel(), exchanges, tape)
        return
    nz, nx = concentration.shape
    gain = np.empty((nz, nx))
    ends = np.empty((nz, 2), np.int64)
    in_rows(ends_of_tracer, nz, nz * nx, concentration, ends)
    in_rows(gains_from_neighbours, nz, nz * nx, concentration, exchanges, ends, gain, negligible)
    in_rows(add_gains, nz, nz * nx, concentration, gain, storage, ends)
