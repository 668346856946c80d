"""The porosity is not the nominal one: porosity * factor everywhere."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, factor_off_one
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import factor

DEVIATION = 0.04
"""Standard deviation of the believed logarithm of the factor [-]."""


LEAST_FITTED = 0.2
"""Least factor [-] that fits and siblings consider."""


def scale(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another porosity."""
    return replace(physics, porosity=physics.porosity * values['factor'])


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor up to the one that makes the largest porosity 1."""
    return [_in_steps(context.rig, 0.015)]


def believed(rig: Rig) -> Sequence[Candidate]:
    """Believe in a porosity as described, to DEVIATION."""
    return [_in_steps(rig, DEVIATION)]


def _in_steps(rig: Rig, step: float) -> Candidate:
    largest = min(MOST_FACTOR, 1.0 / float(np.max(np.asarray(rig.nominal_map('porosity')))))
    return Candidate(
        'porosity', (FitParameter('factor', '-', 1.0, step, LEAST_FITTED, largest, log=True),)
    )


def phrase(values: Values) -> str:
    """Say how much higher or lower the porosity is."""
    high = factor(values['factor'], 'higher than', 'lower than', 'as high as')
    return f'the porosity is {high} nominal'


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw a porosity that is 2 to 10 % higher or lower."""
    return {'factor': factor_off_one(generator, 0.02, 0.1)}


def equal_to(values: Values) -> tuple[str, ...]:
    """A higher porosity is the same as sorption; a lower one is not."""
    return ('retardation',) if float(values['factor']) > 1 else ()


EFFECT = Effect(
    name='porosity',
    order=80,
    scope=Scope.RIG,
    parameters={
        'factor': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    on_physics=scale,
    candidates=candidates,
    phrase=phrase,
    laboratory_check='weigh the water that fills the rig, measure the gap between the plates, and '
    'check the rates of all pumps',
    also='a wrong depth of the whole rig, or one factor on the rates of all pumps',
    blind_draw=draw,
    changes=Process.STORAGE,
    appearance=Appearance.DELAY,
    equal_to=equal_to,
    believed=believed,
)
