"""A round zone is more or less permeable than the nominal sand, with a smooth edge.

log k changes by log(permeability_factor) * (1 - tanh((r - radius) / (0.12 radius))) / 2, r the
distance from (x, z).
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.random import Generator

from porotwin_core.model.blind_draw import (
    DrawContext,
    DrawnValues,
    log_uniform,
    place_near_injector,
)
from porotwin_core.model.effect_limits import LEAST_RADIUS, MOST_DISTANCE, MOST_PERMEABILITY_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import (
    Candidate,
    FitParameter,
    PlaceSearch,
    SearchContext,
)
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import factor, number, place

EDGE = 0.12
"""Width of the edge relative to the radius."""

FIRST_RADIUS_M = 0.06
"""Radius of the zone before its place is known [m]."""

TRIAL_RADIUS = 0.06
"""Radius of the zones that are tried, relative to the longer side of the rig."""

TRIAL_FACTORS = (0.25, 4.0)
"""Permeability of the zones that are tried, relative to the nominal one."""

SIZED_TRIALS = tuple(product((TRIAL_RADIUS, 0.036, 0.024), (0.25, 0.5, 2.0, 4.0)))
"""Relative radius and permeability of the zones that are tried where a leak imitates a zone."""


def change_zone(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another permeability in the zone."""
    grid, radius = physics.grid, values['radius']
    distance = np.hypot(grid.x[None, :] - values['x'], grid.z[:, None] - values['z'])
    inside = 0.5 * (1.0 - np.tanh((distance - radius) / (EDGE * radius)))
    return replace(
        physics, permeability=physics.permeability * values['permeability_factor'] ** inside
    )


def zone_at(
    context: SearchContext, centre: tuple[float, float], radius: float, permeability_factor: float
) -> Candidate:
    """Return the zone whose fit starts at `centre` [m] with `radius` [m] and the given factor."""
    rig, size = context.rig, context.longer_side
    strength = FitParameter('permeability_factor', '-', 1.0, 0.3, 1e-3, 1e3, log=True)
    parameters = (
        FitParameter('x', 'm', centre[0], 0.004 * size, 0.0, rig.width_m),
        FitParameter('z', 'm', centre[1], 0.004 * size, 0.0, rig.height_m),
        FitParameter('radius', 'm', radius, 0.1, 0.008 * size, 0.4 * size, log=True),
        strength,
    )
    start = (0.0, 0.0, 0.0, strength.scaled(permeability_factor))
    return Candidate('heterogeneity', parameters, starts=(start,))


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit a zone that starts in the middle, without effect."""
    return [zone_at(context, context.middle, FIRST_RADIUS_M, 1.0)]


def trials(context: SearchContext, centre: tuple[float, float]) -> Sequence[Candidate]:
    """Try a tight and a permeable zone."""
    radius = TRIAL_RADIUS * context.longer_side
    return [zone_at(context, centre, radius, tried) for tried in TRIAL_FACTORS]


def sized_trials(context: SearchContext, centre: tuple[float, float]) -> Sequence[Candidate]:
    """Try tight and permeable zones of several sizes."""
    size = context.longer_side
    return [zone_at(context, centre, radius * size, tried) for radius, tried in SIZED_TRIALS]


def phrase(values: Values) -> str:
    """Say where the zone is, how large, and how permeable."""
    permeable = factor(
        values['permeability_factor'],
        'more permeable than',
        'less permeable than',
        'as permeable as',
    )
    return (
        f'a zone of {number(1e3 * values["radius"])} mm radius at {place(values)} '
        f'is {permeable} the nominal sand'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a tight (three in five) or permeable zone of 3 to 6 cm radius near the injector."""
    x, z = place_near_injector(generator, context)
    is_tight = generator.random() < 0.6
    strength = log_uniform(generator, 0.05, 0.4) if is_tight else log_uniform(generator, 3, 12)
    radius = float(generator.uniform(0.03, 0.06)) * context.size
    return {'x': x, 'z': z, 'radius': radius, 'permeability_factor': strength}


EFFECT = Effect(
    name='heterogeneity',
    order=70,
    scope=Scope.PLACE,
    parameters={
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'radius': Parameter(unit='m', low=LEAST_RADIUS, high=MOST_DISTANCE, is_scored=False),
        'permeability_factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
            is_logarithmic=True,
        ),
    },
    on_physics=change_zone,
    candidates=candidates,
    places=PlaceSearch(trials, strength_factors=(0.3, 2.0), sized_trials=sized_trials),
    phrase=phrase,
    plainly='a zone of other sand',
    laboratory_check='look at the sand there; inject from a well close to it',
    blind_draw=draw,
    appearance=Appearance.BENDING,
    is_learnable=True,
)
