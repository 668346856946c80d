"""A part of the pore water does not move: d c_im/dt = exchange_rate (c - c_im).

The camera sees the mean of both parts, weighted by volume.
"""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_limits import MOST_CHANGE
from porotwin_core.model.effect_parameter import Parameter, Reading, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Process, Scope
from porotwin_solver.effects.definition.words import number, time_span

LEAST_EXCHANGE = 0.3
"""Least exchange rate [-] times the duration of a recording that a search tries: a quarter of the
immobile water takes part. With less, immobile water is a lower porosity. A calibrated camera
cannot tell them apart, because the calibration took the paler core for stock."""

MOST_EXCHANGE = 30.0
"""Largest exchange rate [-] times the duration of a recording that a search tries. Faster exchange
spreads a front as dispersion does, and no recording tells them apart. With a rate of 1/s the steps
of the model alone decided, and a left-out dispersion was called immobile water with 0.98."""

MOST_IMMOBILE = 0.95
"""Largest immobile fraction: the flow needs some mobile water."""


def divide(physics: Physics, values: Values) -> Physics:
    """Return `physics` with mobile and immobile water."""
    return replace(
        physics,
        immobile_fraction=values['immobile_fraction'],
        exchange_rate=values['exchange_rate'],
    )


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit both parameters, starting from exchange within the recording and 4.5 times faster."""
    duration = context.duration
    immobile = FitParameter('immobile_fraction', '-', 0.04, 0.3, 1e-4, 0.8, log=True)
    exchange = FitParameter(
        'exchange_rate',
        '1/s',
        1.0 / duration,
        0.5,
        LEAST_EXCHANGE / duration,
        min(MOST_EXCHANGE / duration, MOST_CHANGE),
        log=True,
    )
    return [Candidate('dual_porosity', (immobile, exchange), starts=((0.0, 0.0), (0.0, 3.0)))]


def phrase(values: Values) -> str:
    """Say how much water is immobile, and how fast it exchanges."""
    still = f'{number(100 * values["immobile_fraction"])} % of the pore water stand still and '
    if values['exchange_rate'] == 0.0:
        return f'{still}exchange no tracer with the rest'
    return f'{still}exchange tracer with the rest within {time_span(1 / values["exchange_rate"])}'


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw 2.5 to 10 % of immobile water, which exchanges 0.4 to 1.8 times in the recording."""
    return {
        'immobile_fraction': log_uniform(generator, 0.025, 0.1),
        'exchange_rate': log_uniform(generator, 0.4, 1.8) / context.duration,
    }


EFFECT = Effect(
    name='dual_porosity',
    order=60,
    scope=Scope.RIG,
    parameters={
        'immobile_fraction': Parameter(
            unit='-', low=0.0, high=MOST_IMMOBILE, reading=Reading(100.0, '%')
        ),
        'exchange_rate': Parameter(
            unit='1/s', low=0.0, high=MOST_CHANGE, reading=Reading(3600.0, 'per hour')
        ),
    },
    on_physics=divide,
    candidates=candidates,
    phrase=phrase,
    plainly='a part of the water stands still',
    laboratory_check='inject water after the tracer and watch how slowly the producer gets clear',
    blind_draw=draw,
    changes=Process.STORAGE,
    appearance=Appearance.DELAY,
    pales_core=True,
    present=lambda physics: {
        'immobile_fraction': physics.immobile_fraction,
        'exchange_rate': physics.exchange_rate,
    },
)
