"""A well injects factor times the commanded concentration since a time: another bottle."""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.model.effect_parameter import ONSET, Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import begun, number


def exchange(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another factor of the injected concentration."""
    well, factors = physics.well(values['well']), dict(physics.stock_factors)
    factors[well] = factors.get(well, 1.0) * values['factor']
    return replace(physics, stock_factors=factors)


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit it from the start beside another well with tracer; alone it looks like a pale camera."""
    return begins(context) if len(context.tracer_wells) > 1 else []


def begins(context: SearchContext) -> Sequence[Candidate]:
    """Fit the strength of a bottle in steps of 3 %, where a well injects tracer.

    Stock is the strongest tracer, 1.
    """
    if context.well not in context.tracer_wells:
        return []
    factor = FitParameter('factor', '-', 1.0, 0.03, 0.0, 1.0)
    return [Candidate('stock_strength', (factor,), {'well': context.well})]


def phrase(values: Values) -> str:
    """Say how strong the tracer of the well is."""
    strength = number(100 * values['factor'])
    return f'the tracer of {values["well"]} has {strength} % of its strength{begun(values)}'


EFFECT = Effect(
    name='stock_strength',
    order=103,
    scope=Scope.WELL,
    parameters={
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'factor': Parameter(unit='-', low=0.0, high=1.0, neutral=1.0),
        'since': ONSET,
    },
    on_physics=exchange,
    candidates=candidates,
    begins=begins,
    phrase=phrase,
    plainly='a bottle of tracer is weaker',
    laboratory_check='put a drop of each bottle between two plates and photograph both',
    appearance=Appearance.FADING,
)
