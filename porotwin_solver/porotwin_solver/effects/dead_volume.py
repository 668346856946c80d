"""The tube of a well is full of water at first: its tracer arrives volume / rate late."""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.basis.units import ML
from porotwin_core.model.effect_limits import MOST_TUBE_ML
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import number


def fill(physics: Physics, values: Values) -> Physics:
    """Return `physics` with more water in the tube of the well."""
    well, volumes = physics.well(values['well']), dict(physics.dead_volumes)
    volumes[well] = volumes.get(well, 0.0) + values['volume'] / ML
    return replace(physics, dead_volumes=volumes)


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the volume in steps that delay the tracer by 1 % of the recording, up to half of it."""
    if context.well not in context.tracer_wells:
        return []
    pumped = context.strongest_rate * context.duration * ML
    volume = FitParameter('volume', 'ml', 0.0, 0.01 * pumped, 0.0, min(0.5 * pumped, MOST_TUBE_ML))
    return [Candidate('dead_volume', (volume,), {'well': context.well})]


def phrase(values: Values) -> str:
    """Say how much water the tube holds."""
    return f'the tube of {values["well"]} holds {number(values["volume"])} ml of water'


def gradient_obstacle(_physics: Physics, _parameter: str) -> str:
    """Refuse the gradient: the adjoint steps through fixed times."""
    return 'not available; leave it out'


EFFECT = Effect(
    name='dead_volume',
    order=106,
    scope=Scope.WELL,
    parameters={
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'volume': Parameter(unit='ml', low=0.0, high=MOST_TUBE_ML),
    },
    on_physics=fill,
    candidates=candidates,
    phrase=phrase,
    plainly='tracer arrives late through a tube',
    laboratory_check='time the tracer from the pump to the well',
    appearance=Appearance.DELAY,
    gradient_obstacle=gradient_obstacle,
)
