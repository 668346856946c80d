"""The light changes: signal = c (1 + level + drift t + gradient (x - W/2)), clipped to 0..1."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.basis.units import HOUR_S, MINUTE_S
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform, random_sign
from porotwin_core.model.effect_limits import MOST_CHANGE, MOST_FACTOR, MOST_LIGHT_GRADIENT
from porotwin_core.model.effect_parameter import ONSET, Parameter, Reading, Values
from porotwin_solver.coefficients.observation_operator import ObservationOperator
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import begun, direction, number


def light(operator: ObservationOperator, values: Values) -> ObservationOperator:
    """Return `operator` with more light, drift and gradient."""
    return replace(
        operator,
        level=operator.level + values['level'],
        drift=operator.drift + values['drift'],
        gradient=operator.gradient + values['gradient'],
    )


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both in steps that change the signal by 3 % at the end and at the sides."""
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
                    MOST_CHANGE,
                ),
                _gradient(context),
            ),
        )
    ]


def begins(context: SearchContext) -> Sequence[Candidate]:
    """Fit the light of a lamp and its gradient, likewise."""
    level = FitParameter('level', '-', 0.0, 0.03, -1.0, 1.0)
    return [Candidate('illumination', (level, _gradient(context)))]


def _gradient(context: SearchContext) -> FitParameter:
    step = 0.06 / context.longer_side
    return FitParameter('gradient', '1/m', 0.0, step, -MOST_LIGHT_GRADIENT, MOST_LIGHT_GRADIENT)


def phrase(values: Values) -> str:
    """Say how the signal changes in time and across the rig."""
    level, drift = (float(values.get(name, 0.0)) for name in ('level', 'drift'))
    hourly = abs(drift) * HOUR_S
    # more than all of it within an hour is a change within minutes
    amount = f'{number(100.0 * hourly)} %/h'
    if hourly > 1.0:
        amount = f'{number(100.0 * hourly * MINUTE_S / HOUR_S)} %/min'
    changes = f'{"grows" if drift >= 0 else "falls"} by {amount}'
    if level and not drift:
        changes = f'is {direction(level, "stronger", "weaker", "%", 100.0)}'
    side = direction(values['gradient'], 'stronger', 'weaker', '% per 10 cm', 10)
    return f'the tracer’s signal {changes}, and is {side} to the right{begun(values)}'


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
        'level': Parameter(
            unit='-', low=-1.0, high=MOST_FACTOR, default=0.0, reading=Reading(100.0, '%')
        ),
        'drift': Parameter(unit='1/s', low=-MOST_CHANGE, high=MOST_CHANGE, default=0.0),
        'gradient': Parameter(
            unit='1/m', low=-MOST_LIGHT_GRADIENT, high=MOST_LIGHT_GRADIENT, default=0.0
        ),
        'since': ONSET,
    },
    on_observation=light,
    candidates=candidates,
    begins=begins,
    phrase=phrase,
    plainly='the light changes',
    laboratory_check='photograph a grey card at the start and the end, left and right',
    blind_draw=draw,
    appearance=Appearance.FADING,
    pales_core=True,
    needs_simulation=False,
)
