"""A point p of the rig appears at C + scale R(rotation) (p - C) + (dx, dz), C the rig's middle.

R rotates counter-clockwise.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, displacement
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_FACTOR, MOST_ROTATION
from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import begun, direction, factor

STEP_CELLS = 0.4
"""Natural step: the displacement of a point 0.4 half-sides from the middle, in cells."""

MOST_SHIFT = 0.1
"""Largest fitted displacement, relative to half the longer side."""

MOST_TURN = 0.1
"""Largest fitted rotation [rad] and deviation of the scale from 1."""


def move(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Return `operator` followed by the displacement: two similarities in a row are one."""
    scale, rotation = values['scale'], values['rotation']
    cosine, sine = math.cos(rotation), math.sin(rotation)
    return replace(
        operator,
        dx=scale * (cosine * operator.dx - sine * operator.dz) + values['dx'],
        dz=scale * (sine * operator.dx + cosine * operator.dz) + values['dz'],
        rotation=operator.rotation + rotation,
        scale=operator.scale * scale,
    )


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit displacement, rotation and scale, starting from a picture in its place."""
    half = 0.5 * context.longer_side
    shift = STEP_CELLS * context.grid.dx
    turn = shift / (0.4 * half)
    parameters = (
        FitParameter('dx', 'm', 0.0, shift, -MOST_SHIFT * half, MOST_SHIFT * half),
        FitParameter('dz', 'm', 0.0, shift, -MOST_SHIFT * half, MOST_SHIFT * half),
        FitParameter('rotation', 'rad', 0.0, turn, -MOST_TURN, MOST_TURN),
        FitParameter('scale', '-', 1.0, turn, 1 - MOST_TURN, 1 + MOST_TURN),
    )
    return [Candidate('registration', parameters)]


def phrase(values: Values) -> str:
    """Say how the picture is displaced, rotated and scaled."""
    rotated = direction(
        values['rotation'], 'counter-clockwise', 'clockwise', 'degrees', 180 / math.pi
    )
    return (
        f'the picture is shifted {direction(values["dx"], "right", "left")} and '
        f'{direction(values["dz"], "up", "down")}, turned {rotated}, and '
        f'{factor(values["scale"], "too large", "too small", "the right size")}{begun(values)}'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw a picture displaced by 1.5 to 6 mm each way, rotated and scaled by up to 1.5 %."""
    return {
        **displacement(generator, context),
        'rotation': float(generator.uniform(-0.015, 0.015)),
        'scale': float(1.0 + generator.uniform(-0.015, 0.015)),
    }


EFFECT = Effect(
    name='registration',
    order=160,
    scope=Scope.CAMERA,
    parameters={
        'dx': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'dz': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'rotation': Parameter(
            unit='rad', low=-MOST_ROTATION, high=MOST_ROTATION, default=0.0, is_scored=False
        ),
        'scale': Parameter(
            unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, default=1.0, neutral=1.0
        ),
        'since': ONSET,
    },
    on_observation=move,
    candidates=candidates,
    begins=candidates,
    phrase=phrase,
    plainly='the picture is shifted, turned or scaled',
    laboratory_check='photograph a scale in the rig and mark its corners again',
    blind_draw=draw,
    appearance=Appearance.SHIFT,
    needs_simulation=False,
)
