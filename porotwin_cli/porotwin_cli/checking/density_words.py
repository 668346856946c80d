"""How far a small density difference moves the tracer of an experiment by itself, in words."""

import numpy as np

from porotwin_core.basis.units import GRAVITY
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.discs import radial_front
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.effects.definition.words import number

DENSITY_DIFFERENCE = 1.0
"""Density difference of the example [kg/m^3]: 0.1 % of salt or dye in the stock."""

NOTABLE = 0.1
"""Least way of the tracer, relative to the radius of its plume, that makes density worth a test."""


def density_words(rig: Rig, grid: Grid, stock: float, seconds: float) -> str:
    """Return how far tracer that is 1 kg/m^3 denser than water sinks, beside the plume's radius.

    The speed of pore water that density alone drives is u = k g (rho - rho_water) / (mu porosity)
    (Bear, Dynamics of Fluids in Porous Media, section 5.2). A round plume of the volume V has the
    radius sqrt(V / (pi porosity depth)). The most permeable sand counts, or else the median of all
    cells; and the median of the depth.

    Args:
        rig: the rig.
        grid: cells of the rig.
        stock: injected volume of tracer stock [m^3], above 0.
        seconds: duration of the experiment [s].
    """
    physics = nominal_physics(rig, grid)
    sand = max(rig.placed_sands, key=rig.permeability_of_sand, default='')
    if sand:
        permeability, porosity = rig.permeability_of_sand(sand), rig.sands[sand].porosity
    else:
        permeability = float(np.median(physics.permeability))
        porosity = float(np.median(physics.porosity))
    depth = float(np.median(physics.depth))
    speed = permeability * GRAVITY * DENSITY_DIFFERENCE / (physics.viscosity * porosity)
    way = min(speed * seconds, rig.height_m)
    radius = radial_front(stock, thickness=porosity * depth)
    words = (
        f'density: stock that is {DENSITY_DIFFERENCE:g} kg/m3 denser or lighter than water moves '
        f'{number(1e3 * way, 2)} mm by itself in this time'
        f'{f" in the most permeable sand, {sand}" if sand else ""}; its plume has a radius of '
        f'{number(1e3 * radius, 2)} mm'
    )
    if way > NOTABLE * radius:
        words += (
            '; weigh stock and water, and write a difference into `effects:` of rig.yaml '
            '(buoyancy, docs/effects.md)'
        )
    return words
