"""The light changes: signal = c (1 + drift t + gradient (x - W/2)), clipped to 0..1."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.basis.units import HOUR_S, MINUTE_S
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_LIGHT_DRIFT, MOST_LIGHT_GRADIENT
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import direction, number


def light(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Return `operator` with more drift and gradient."""
    return replace(
        operator,
        drift=operator.drift + values['drift'],
        gradient=operator.gradient + values['gradient'],
    )


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both in steps that change the signal by 3 % at the end and at the sides."""
    half = 0.5 * context.longer_side
    return [
        Candidate(
            'illumination',
            (
                FitParameter(
                    'drift',
                    '1/s',
                    0.0,
                    0.03 / context.duration,
                    -1.0 / context.duration,  # the signal would be gone at the end
                    MOST_LIGHT_DRIFT,
                ),
                FitParameter(
                    'gradient', '1/m', 0.0, 0.03 / half, -MOST_LIGHT_GRADIENT, MOST_LIGHT_GRADIENT
                ),
            ),
        )
    ]


def phrase(values: Values) -> str:
    """Say how the signal changes in time and across the rig."""
    hourly = abs(values['drift']) * HOUR_S
    # more than all of it within an hour is a change within minutes
    drift = f'{number(100.0 * hourly)} %/h'
    if hourly > 1.0:
        drift = f'{number(100.0 * hourly * MINUTE_S / HOUR_S)} %/min'
    return (
        f'the tracer’s signal {"grows" if values["drift"] >= 0 else "falls"} by {drift}, and is '
        f'{direction(values["gradient"], "stronger", "weaker", "% per 10 cm", 10)} to the right'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw light that fades by 8 to 30 %, with a gradient of 5 to 30 % per metre."""
    return {
        'drift': -log_uniform(generator, 0.08, 0.3) / context.duration,
        'gradient': random_sign(generator) * log_uniform(generator, 0.05, 0.3) / context.size,
    }


EFFECT = Effect(
    name='illumination',
    order=150,
    scope=Scope.CAMERA,
    parameters={
        'drift': Parameter(unit='1/s', low=-MOST_LIGHT_DRIFT, high=MOST_LIGHT_DRIFT, default=0.0),
        'gradient': Parameter(
            unit='1/m', low=-MOST_LIGHT_GRADIENT, high=MOST_LIGHT_GRADIENT, default=0.0
        ),
    },
    on_observation=light,
    candidates=candidates,
    phrase=phrase,
    plainly='the light changes',
    laboratory_check='photograph a grey card at the start and the end, left and right',
    blind_draw=draw,
    appearance=Appearance.FADING,
    pales_core=True,
    needs_simulation=False,
)
