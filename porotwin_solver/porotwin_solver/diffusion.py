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

from porotwin_solver.compiled import compiled, sort_by_pace, starting_level
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
    grid = physics.grid
    isotropic = physics.diffusion + physics.model_diffusion
    along, across = physics.longitudinal_dispersivity, physics.transverse_dispersivity
    shape = grid.shape
    if along == 0.0 and across == 0.0:
        return np.full(shape, isotropic), np.zeros(shape), np.full(shape, isotropic)
    mobile = physics.depth * physics.porosity * (1.0 - physics.immobile_fraction)
    vx = 0.5 * (flux.x[:, :-1] + flux.x[:, 1:]) / (grid.dz * mobile)
    vz = 0.5 * (flux.z[:-1] + flux.z[1:]) / (grid.dx * mobile)
    speed = np.hypot(vx, vz)
    stretch = (along - across) / np.where(speed > 0, speed, 1.0)
    round_part = across * speed + isotropic
    return round_part + stretch * vx * vx, stretch * vx * vz, round_part + stretch * vz * vz


def exchanges(physics: Physics, flux: FaceField, time_step: float) -> Exchanges:
    """Return the exchanges of all cells for the flux through their faces, over `time_step` [s]."""
    grid = physics.grid
    xx, xz, zz = tensor(physics, flux)
    mobile = 1.0 - physics.immobile_fraction
    return Exchanges(
        time_step,
        *_exchanges(
            xx / grid.dx**2,
            xz / (grid.dx * grid.dz),
            zz / grid.dz**2,
            physics.volume * physics.porosity * mobile,
            physics.storage * mobile,
            time_step,
            LARGEST_SHARE,
        ),
    )


def diffuse(concentration: FloatArray, storage: FloatArray, pairs: Exchanges) -> None:
    """Advance `concentration` (nz, nx) in place by `pairs.time_step`.

    `storage` (nz, nx) [m^3] is the volume of every cell that holds tracer.
    """
    _diffuse(
        concentration.ravel(),
        storage.ravel(),
        pairs.time_step,
        pairs.start,
        pairs.other,
        pairs.weight,
        pairs.level.ravel(),
        pairs.order,
        pairs.reach,
    )


@compiled
def _superbase(xx, xz, zz, offset, weight):
    """Fill the three offsets (column, row) and weights with sum of weight offset offset^T = D."""
    ax, az, bx, bz = 1, 0, 0, 1
    cx, cz = -1, -1
    for _ in range(100):
        ab = ax * (xx * bx + xz * bz) + az * (xz * bx + zz * bz)
        bc = bx * (xx * cx + xz * cz) + bz * (xz * cx + zz * cz)
        ca = cx * (xx * ax + xz * az) + cz * (xz * ax + zz * az)
        tiny = 1e-14 * (xx + zz)
        if ab > tiny:
            ax, az, cx, cz = -ax, -az, ax - bx, az - bz
        elif bc > tiny:
            bx, bz, ax, az = -bx, -bz, bx - cx, bz - cz
        elif ca > tiny:
            cx, cz, bx, bz = -cx, -cz, cx - ax, cz - az
        else:
            break
    offset[0, 0], offset[0, 1] = -cz, cx
    offset[1, 0], offset[1, 1] = -az, ax
    offset[2, 0], offset[2, 1] = -bz, bx
    weight[0] = max(-(ax * (xx * bx + xz * bz) + az * (xz * bx + zz * bz)), 0.0)
    weight[1] = max(-(bx * (xx * cx + xz * cz) + bz * (xz * cx + zz * cz)), 0.0)
    weight[2] = max(-(cx * (xx * ax + xz * az) + cz * (xz * ax + zz * az)), 0.0)


@compiled
def _exchanges(xx, xz, zz, water, storage, time_step, largest):
    nz, nx = xx.shape
    size = nz * nx
    offset = np.empty((3, 2), np.int64)
    weight = np.empty(3)
    # Each cell gives half of its own weights to the pairs on both sides of it.
    first = np.empty(6 * size, np.int32)
    second = np.empty(6 * size, np.int32)
    volume = np.empty(6 * size)
    total = np.zeros(size)
    count = 0
    for i in range(nz):
        for j in range(nx):
            _superbase(xx[i, j], xz[i, j], zz[i, j], offset, weight)
            for k in range(3):
                if weight[k] <= 0.0:
                    continue
                for side in (-1, 1):
                    m, n = i + side * offset[k, 1], j + side * offset[k, 0]
                    if 0 <= m < nz and 0 <= n < nx:
                        first[count] = i * nx + j
                        second[count] = m * nx + n
                        volume[count] = 0.5 * weight[k] * water[i, j]
                        total[first[count]] += volume[count]
                        total[second[count]] += volume[count]
                        count += 1
    level = np.empty((nz, nx), np.int8)
    flat = level.ravel()
    order, reach = sort_by_pace(total / storage.ravel(), time_step, largest, flat)
    start = np.zeros(size + 1, np.int32)
    for k in range(count):
        owner = first[k] if flat[first[k]] >= flat[second[k]] else second[k]
        start[owner + 1] += 1
    for k in range(size):
        start[k + 1] += start[k]
    place = start[:-1].copy()
    other = np.empty(count, np.int32)
    sorted_volume = np.empty(count)
    for k in range(count):
        owner, partner = first[k], second[k]
        if flat[owner] < flat[partner]:
            owner, partner = partner, owner
        other[place[owner]] = partner
        sorted_volume[place[owner]] = volume[k]
        place[owner] += 1
    return start, other, sorted_volume, level, order, reach


@compiled
def _diffuse(c, storage, time_step, start, other, weight, level, order, reach):
    gain = np.zeros(len(c))
    top = len(reach) - 1
    for step in range(1 << top):
        for place in range(reach[starting_level(step, top)]):
            k = order[place]
            length = time_step / (1 << level[k])
            for pair in range(start[k], start[k + 1]):
                difference = c[other[pair]] - c[k]
                if difference != 0.0:
                    moved = length * weight[pair] * difference
                    gain[k] += moved
                    gain[other[pair]] -= moved
        for place in range(reach[starting_level(step + 1, top)]):
            k = order[place]
            if gain[k] != 0.0:
                c[k] += gain[k] / storage[k]
                gain[k] = 0.0
