"""One pump delivers factor times the commanded rate since a time. In a closed rig sinks follow."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, factor_off_one
from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_core.rates.delivered_rates import RATE_DEVIATION, rate_deviations
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import begun, number


def misdeliver(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another rate factor of the well."""
    well = physics.well(values['well'])
    factors = dict(physics.rate_factors)
    factors[well] = factors.get(well, 1.0) * values['factor']
    return replace(physics, rate_factors=factors)


DELIVERED = (0.0, 5.0)
"""Range of the factors [-] that fits and siblings consider."""


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the factor of a pumping well; in a closed rig the sinks follow.

    An unknown rate is fitted beside every effect (`unknown_rates`) instead.
    """
    if context.rig.wells[context.well].rate_prior_ml_h is not None:
        return []
    factor = FitParameter('factor', '-', 1.0, 0.02, *DELIVERED)
    return [Candidate('rate', (factor,), {'well': context.well})]


def believed(rig: Rig) -> Sequence[Candidate]:
    """Believe in pumps that deliver as commanded, to RATE_DEVIATION or as far as rig.yaml knows."""
    # by name, so that the order of the wells in rig.yaml changes no draw
    return [_of_well(name, deviation) for name, deviation in sorted(rate_deviations(rig).items())]


def unknown_rates(rig: Rig, wells: Iterable[str]) -> list[Candidate]:
    """Return the factors of those of the `wells` whose rate nobody measured."""
    return [_of_well(name, RATE_DEVIATION) for name in wells if rig.wells[name].rate_prior_ml_h]


def _of_well(well: str, step: float) -> Candidate:
    """Return the factor of a `well`, in steps of its logarithm [-]."""
    factor = FitParameter('factor', '-', 1.0, step, *DELIVERED, log=True)
    return Candidate('rate', (factor,), {'well': well})


def rate_factors(effects: Iterable[EffectDescription]) -> dict[str, float]:
    """Return the delivered over the commanded rate [-] of every well that `effects` name."""
    found: dict[str, float] = {}
    for one in effects:
        if one.name == EFFECT.name:
            well, factor = str(one.parameters['well']), float(one.parameters['factor'])
            found[well] = found.get(well, 1.0) * factor
    return found


def phrase(values: Values) -> str:
    """Say how much the pump delivers."""
    delivered = number(100 * values['factor'])
    words = f'pump {values["well"]} delivers {delivered} % of the commanded rate'
    return words + begun(values)


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an injector that delivers 2.5 to 9 % too much or too little."""
    return {'well': context.wells[0], 'factor': factor_off_one(generator, 0.025, 0.09)}


EFFECT = Effect(
    name='rate',
    order=100,
    scope=Scope.WELL,
    parameters={
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, neutral=1.0),
        'since': ONSET,
    },
    on_physics=misdeliver,
    candidates=candidates,
    begins=candidates,
    believed=believed,
    phrase=phrase,
    plainly='a pump delivers too much or too little',
    laboratory_check='let the pump fill a measuring cylinder until it holds some 50 ml',
    blind_draw=draw,
    appearance=Appearance.DELAY,
)
