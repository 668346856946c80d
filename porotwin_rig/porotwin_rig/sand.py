"""The true sand: permeability, porosity and depth with the effects the owner does not know."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig
from porotwin_core.units import GRAVITY
from porotwin_rig.effects import Effects
from porotwin_rig.mesh import Mesh

FloatArray = NDArray[np.floating]
Quantity = Literal['depth_m', 'porosity', 'permeability_m2']


@dataclass(frozen=True)
class Sand:
    """`along_x`, `along_z` (nz, nx): hydraulic conductivity times depth [m^2/s] of the elements.

    `pore_depth` (nz + 1, nx + 1): porosity times depth [m] of the vertices' boxes; `depth` [m]
    likewise.
    """

    along_x: FloatArray
    along_z: FloatArray
    pore_depth: FloatArray
    depth: FloatArray


def true_sand(rig: Rig, mesh: Mesh, effects: Effects) -> Sand:
    """Return the sand of `rig` on `mesh` as it is, not as its owner believes.

    Raises:
        InputError: the porosity exceeds 1.
    """
    elements = mesh.elements
    x, z = np.meshgrid(elements.x, elements.z)
    permeability = _nearest(rig, 'permeability_m2', mesh)
    for zone in effects.all('heterogeneity'):
        permeability = permeability * _zone(zone, x, z)
    for streak in effects.all('streak'):
        permeability = permeability * _streak(streak, x, z)
    bulge = effects.number('depth', 'factor_centre')
    conductivity = permeability * (rig.density_kg_m3 * GRAVITY / rig.viscosity_pa_s)
    transmissivity = conductivity * _nearest(rig, 'depth_m', mesh) * _bulging(x, rig, bulge)
    along_x, along_z = transmissivity, transmissivity
    for layer in effects.all('anisotropy'):
        inside = (z >= float(layer['z_low'])) & (z <= float(layer['z_high']))
        stretch = np.where(inside, math.sqrt(float(layer['ratio'])), 1.0)
        along_x, along_z = along_x * stretch, along_z / stretch
    depth = _averaged(rig, 'depth_m', mesh) * _bulging(mesh.x[None, :], rig, bulge)
    porosity = _averaged(rig, 'porosity', mesh) * effects.number('porosity', 'factor')
    if porosity.max() > 1.0 + 1e-9:  # a mean over a map of ones may be off by round-off
        raise InputError(
            f'porosity {porosity.max():.6g}: must not exceed 1; '
            "lower its map or the factor of effect 'porosity'"
        )
    return Sand(along_x, along_z, porosity * depth, depth)


def _nearest(rig: Rig, quantity: Quantity, mesh: Mesh) -> FloatArray:
    """Return a nominal map on the elements, each taking the value at its middle.

    Averaging would soften the interfaces between sands, which are sharp.
    """
    nominal = rig.nominal_map(quantity)
    if isinstance(nominal, float):
        return np.full((mesh.nz, mesh.nx), nominal)
    rows = ((np.arange(mesh.nz) + 0.5) * nominal.shape[0] / mesh.nz).astype(int)
    columns = ((np.arange(mesh.nx) + 0.5) * nominal.shape[1] / mesh.nx).astype(int)
    return nominal[np.ix_(rows, columns)]


def _averaged(rig: Rig, quantity: Quantity, mesh: Mesh) -> FloatArray:
    nominal = rig.nominal_map(quantity)
    if isinstance(nominal, float):
        return np.full(mesh.shape, nominal)
    return mesh.to_vertices(nominal)


def _bulging(x: FloatArray, rig: Rig, factor_centre: float) -> FloatArray:
    half = 0.5 * rig.width_m
    return 1.0 + (factor_centre - 1.0) * (1.0 - ((x - half) / half) ** 2)


def _zone(zone: dict[str, float | str], x: FloatArray, z: FloatArray) -> FloatArray:
    radius = float(zone['radius'])
    distance = np.hypot(x - float(zone['x']), z - float(zone['z']))
    inside = 0.5 * (1.0 - np.tanh((distance - radius) / (0.12 * radius)))
    return float(zone['permeability_factor']) ** inside


def _streak(streak: dict[str, float | str], x: FloatArray, z: FloatArray) -> FloatArray:
    start = np.array([float(streak['x']), float(streak['z'])])
    way = np.array([float(streak['x_end']), float(streak['z_end'])]) - start
    along = ((x - start[0]) * way[0] + (z - start[1]) * way[1]) / max(float(way @ way), 1e-12)
    along = np.clip(along, 0.0, 1.0)
    distance = np.hypot(x - start[0] - along * way[0], z - start[1] - along * way[1])
    on_streak = distance <= 0.5 * float(streak['width'])
    return np.where(on_streak, float(streak['permeability_factor']), 1.0)
