"""The tracer's density differs from water's: q = -k/mu (grad p + density_difference c g e_z).

`density_difference` is that at c = 1; positive where the tracer is denser.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from porotwin_core.basis.units import GRAVITY, HOUR_S
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_DENSITY_DIFFERENCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import direction

SINKING_M_H = 0.03
"""Standard deviation of how far the tracer sinks or rises by its density in an hour [m]."""


def weigh(physics: Physics, values: Values) -> Physics:
    """Return `physics` with this density difference."""
    return replace(physics, density_difference=values['density_difference'])


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the density difference in steps that sink the tracer by two cells."""
    one_cell = (
        context.front_speed
        * context.porosity
        * context.rig.viscosity_pa_s
        / (context.permeability * GRAVITY)
    )
    parameter = FitParameter(
        'density_difference',
        'kg/m3',
        0.0,
        2 * one_cell,
        -MOST_DENSITY_DIFFERENCE,
        MOST_DENSITY_DIFFERENCE,
    )
    return [Candidate('buoyancy', (parameter,))]


def believed(rig: Rig) -> Sequence[Candidate]:
    """Believe in a tracer that sinks or rises by about SINKING_M_H."""
    porosity = float(np.mean(rig.nominal_map('porosity')))
    permeability = float(np.exp(np.mean(np.log(rig.nominal_map('permeability_m2')))))
    # sinking speed [m/s] of 1 kg/m3
    sinking = permeability * GRAVITY / (rig.viscosity_pa_s * porosity)
    step = SINKING_M_H / HOUR_S / sinking
    most = MOST_DENSITY_DIFFERENCE
    return [
        Candidate(
            'buoyancy', (FitParameter('density_difference', 'kg/m3', 0.0, step, -most, most),)
        )
    ]


def phrase(values: Values) -> str:
    """Say whether the tracer is denser or lighter than water."""
    difference = direction(values['density_difference'], 'denser', 'lighter', 'kg/m³', 1)
    return f'the tracer is {difference} than water'


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a difference that sinks or raises the tracer by 2 to 6.5 cm on the small rig."""
    sign, distance = random_sign(generator), log_uniform(generator, 0.02, 0.065)
    return {'density_difference': sign * distance * context.size * context.sinking}


EFFECT = Effect(
    name='buoyancy',
    order=20,
    scope=Scope.RIG,
    parameters={
        'density_difference': Parameter(
            unit='kg/m3', low=-MOST_DENSITY_DIFFERENCE, high=MOST_DENSITY_DIFFERENCE
        )
    },
    on_physics=weigh,
    candidates=candidates,
    phrase=phrase,
    plainly='the tracer is denser or lighter than water',
    laboratory_check=(
        'stop all pumps: the plume goes on sinking or rising; weigh a flask of the stock'
    ),
    blind_draw=draw,
    appearance=Appearance.BENDING,
    present=lambda physics: {'density_difference': physics.density_difference},
    believed=believed,
    is_learnable=True,
)
