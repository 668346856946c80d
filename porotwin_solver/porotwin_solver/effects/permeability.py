"""The permeability is not the described one: permeability * factor everywhere."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from porotwin_core.model.effect_limits import MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import factor
from porotwin_solver.effects.water_level import with_true_levels

CONDUCTIVITY_DEVIATION = 0.3
"""Standard deviation of the log of the hydraulic conductivity of all the sand, where heads drive
water. Wells alone drive the same flow in any sand."""

LEVEL_DEVIATION_M = 1e-3
"""Standard deviation of the difference between two water levels [m]: a ruler on a wet glass."""


def change(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another permeability."""
    return replace(physics, permeability=physics.permeability * values['factor'])


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor where heads drive water, or pressures are read.

    Wells alone drive the same flow in any sand.
    """
    if not (context.measures_pressure or with_true_levels(context.rig).is_driven):
        return []
    fitted = FitParameter('factor', '-', 1.0, 0.05, 0.01, 100.0, log=True)
    return [Candidate('permeability', (fitted,))]


def believed(rig: Rig) -> Sequence[Candidate]:
    """Doubt how much water flows between reservoirs.

    Maps show conductivity times fall only, so that both are one factor on the conductivity.
    """
    if not rig.is_driven:
        return []
    heads = [body.head_m for body in rig.water_bodies.values() if body.head_m is not None]
    level = LEVEL_DEVIATION_M / (max(heads) - min(heads) or rig.height_m)
    deviation = float(np.hypot(CONDUCTIVITY_DEVIATION, level))
    least, most = 1.0 / MOST_PERMEABILITY_FACTOR, MOST_PERMEABILITY_FACTOR
    return [
        Candidate(
            'permeability', (FitParameter('factor', '-', 1.0, deviation, least, most, log=True),)
        )
    ]


def phrase(values: Values) -> str:
    """Say how much more or less permeable the sand is."""
    permeable = factor(
        values['factor'], 'more permeable than', 'less permeable than', 'as permeable as'
    )
    return f'all the sand is {permeable} described'


EFFECT = Effect(
    name='permeability',
    order=75,
    scope=Scope.RIG,
    parameters={
        'factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
            is_logarithmic=True,
        )
    },
    on_physics=change,
    candidates=candidates,
    believed=believed,
    phrase=phrase,
    plainly='the hydraulic conductivity of all the sand differs from the described one',
    laboratory_check='measure the water levels and the outflow, and divide by Darcy’s law',
)
