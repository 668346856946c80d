"""The steady water table of the virtual rig: the height of the wet sand over x.

The wet sand ends where the pressure head is the negative height b of the capillary fringe:
h = z - b (Bear 1972, sec. 8.1). A flow is computed below a guessed height; where its potential
meets z - b is the next guess. The height is smooth, so it is found on a coarse mesh.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import conservative_resample
from porotwin_rig.box_flow import BoxFlow
from porotwin_rig.mesh import Mesh
from porotwin_rig.water_places import WaterPlaces

FloatArray = NDArray[np.floating]

MOST_VERTICES = 5_000
"""Vertices of the mesh on which the height is sought: a flow takes some ten milliseconds."""

LEAST_WET = 1e-4
"""Share of its transmissivity along x that dry sand keeps [-]."""

MOST_GUESSES = 300
"""Guesses before the height counts as not found; 20 to 60 are usual."""

SETTLED = 1e-3
"""Change of the height from guess to guess, in elements, at which it is found."""

Places = Callable[[Mesh], WaterPlaces]
"""Returns where water stands on a mesh."""


class WetSand:
    """The height of the wet sand, and the flow below it.

    Attributes:
        flow: the flow on the mesh of the rig.
        potential: of its held vertices [m of water], (nz + 1, nx + 1).
    """

    def __init__(
        self,
        mesh: Mesh,
        along: tuple[FloatArray, FloatArray],
        places: Places,
        *,
        fringe: float,
        wells: list[tuple[float, float, float]],
        excess: float,
    ) -> None:
        """Find the table of sand with the transmissivities `along` x and z [m^2/s], (nz, nx).

        `fringe` is the height of the capillary fringe [m], `wells` are (x [m], z [m], rate
        [m^3/s]), `excess` is the relative density of stock less 1.

        Raises:
            InputError: it does not settle.
        """
        self._fringe, self._excess = fringe, excess
        factor = max(1.0, math.sqrt(mesh.shape[0] * mesh.shape[1] / MOST_VERTICES))
        coarse = replace(mesh, nx=math.ceil(mesh.nx / factor), nz=math.ceil(mesh.nz / factor))
        there = tuple(conservative_resample(one, (coarse.nz, coarse.nx)) for one in along)
        water = places(coarse)
        top = float(water.level.max()) + fringe
        height = np.full(coarse.nx + 1, top)
        for _ in range(MOST_GUESSES):
            flow, potential = self._below(height, coarse, (there[0], there[1]), water)
            h = flow.potential(wells, held_potential=potential, forced=water.rain)
            found = _crossing(h + water.lowest + fringe, coarse)
            change, height = found - height, 0.5 * (height + found)
            if np.abs(change).max() < SETTLED * coarse.hz:
                break
        else:
            raise InputError('water_table: the virtual rig finds no steady table; lower the rates')
        self.flow, self.potential = self._below(
            np.interp(mesh.x, coarse.x, height), mesh, along, places(mesh)
        )

    def _below(
        self,
        height: FloatArray,
        mesh: Mesh,
        along: tuple[FloatArray, FloatArray],
        water: WaterPlaces,
    ) -> tuple[BoxFlow, FloatArray]:
        """Return the flow below `height` (nx + 1,) [m], and the potential of its held vertices.

        Sides hold water up to its level. Above it they seep, up to the height of zero pressure.
        """
        middle = 0.5 * (height[1:] + height[:-1])
        wet = np.clip((middle - mesh.z[:-1, None]) / mesh.hz, LEAST_WET, 1.0)
        z = np.broadcast_to(mesh.z[:, None], mesh.shape)
        below = water.held & (z <= water.level)
        walls = np.zeros(mesh.shape, dtype=bool)
        walls[:, [0, -1]] = True
        seeping = water.held & ~below & walls & (z <= height - self._fringe)
        standing = water.potential(mesh.z[:, None], self._excess)
        potential = np.zeros(mesh.shape) if standing is None else standing
        potential = np.where(seeping, z - water.lowest, np.where(below, potential, 0.0))
        flow = BoxFlow(
            mesh, along[0] * wet, along[1], held=below | seeping, canal=water.canal & below
        )
        return flow, potential


def _crossing(head: FloatArray, mesh: Mesh) -> FloatArray:
    """Return the lowest height (nx + 1,) [m] at which `head` (nz + 1, nx + 1) [m] equals z."""
    over = head - mesh.z[:, None]
    dry = over < 0.0
    first = np.where(dry.any(axis=0), dry.argmax(axis=0), mesh.nz)
    first = np.clip(first, 1, mesh.nz)
    columns = np.arange(mesh.nx + 1)
    low, high = over[first - 1, columns], over[first, columns]
    share = np.clip(low / np.maximum(low - high, np.finfo(float).tiny), 0.0, 1.0)
    return mesh.z[first - 1] + share * mesh.hz
