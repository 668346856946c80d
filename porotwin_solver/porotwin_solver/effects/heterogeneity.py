"""A round zone is more or less permeable than believed, its edge smooth.

log k changes by log(permeability_factor) * (1 - tanh((r - radius) / (0.12 radius))) / 2.
"""

from dataclasses import replace

import numpy as np

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics

EDGE = 0.12
"""Width of the edge relative to the radius."""


def _change_zone(physics: Physics, values: Values) -> Physics:
    grid, radius = physics.grid, values['radius']
    distance = np.hypot(grid.x[None, :] - values['x'], grid.z[:, None] - values['z'])
    inside = 0.5 * (1.0 - np.tanh((distance - radius) / (EDGE * radius)))
    return replace(
        physics, permeability=physics.permeability * values['permeability_factor'] ** inside
    )


EFFECT = Effect(
    'heterogeneity',
    {
        'x': Parameter('m'),
        'z': Parameter('m'),
        'radius': Parameter('m', above=0.0),
        'permeability_factor': Parameter('-', above=0.0),
    },
    on_physics=_change_zone,
)
