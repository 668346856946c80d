"""The level or the rate of one water body of `rig.yaml` differs from the described one."""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Process, Scope
from porotwin_solver.effects.definition.words import direction, number
from porotwin_solver.effects.water_level import level_step


def change(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another level or rate of the body.

    Raises:
        InputError: the rig has no such body.
    """
    name, known = values['body'], ', '.join(physics.water) or 'none'
    if name not in physics.water:
        raise InputError(f"water_body: no water '{name}' in rig.yaml; known: {known}")
    body = physics.water[name].with_change(values['rise'], values['factor'])
    return replace(physics, water={**physics.water, name: body})


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit every level but the last one, because only differences count, and every rate."""
    rig, found = context.rig, []
    levels = [name for name, body in rig.water_bodies.items() if body.head_m is not None]
    limit = min(rig.height_m, MOST_DISTANCE)
    for name, body in rig.water.items():
        if body.rate_ml_h:
            fitted = FitParameter('factor', '-', 1.0, 0.05, 0.0, MOST_FACTOR)
        elif name in levels[:-1]:
            fitted = FitParameter('rise', 'm', 0.0, level_step(context, 'left'), -limit, limit)
        else:
            continue
        found.append(Candidate('water_body', (fitted,), {'body': name}, variant=name))
    return found


def phrase(values: Values) -> str:
    """Say how the level or the rate differs."""
    if values.get('factor', 1.0) != 1.0:
        return f'water {values["body"]} enters at {number(100 * values["factor"])} % of its rate'
    rise = direction(values.get('rise', 0.0), 'higher', 'lower')
    return f'water {values["body"]} stands {rise} than described'


EFFECT = Effect(
    name='water_body',
    order=136,
    scope=Scope.RIG,
    parameters={
        'body': Parameter(unit='name', is_name=True, is_scored=False),
        'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, default=1.0, neutral=1.0),
    },
    on_physics=change,
    candidates=candidates,
    phrase=phrase,
    plainly='a canal or a reservoir stands higher or lower than described, or rain falls at '
    'another rate',
    laboratory_check='measure all water levels from one horizontal line, and rain by a cylinder',
    changes=Process.SOURCE,
)
