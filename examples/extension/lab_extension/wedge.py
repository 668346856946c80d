"""The plates form a wedge: depth = nominal * (1 + slope (x - W/2)), W the width of the rig."""

from collections.abc import Mapping
from dataclasses import replace

from porotwin_core.model.effect_parameter import Parameter
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope


def tilt(physics: Physics, values: Mapping[str, float]) -> Physics:
    """Return `physics` with a depth that grows to the right."""
    factor = 1.0 + values['slope'] * (physics.grid.x - physics.grid.width / 2)
    return replace(physics, depth=physics.depth * factor)


def candidates(context: SearchContext) -> list[Candidate]:
    """Fit the slope in steps of 2 % at the sides, with a positive depth everywhere."""
    half = context.rig.width_m / 2
    slope = FitParameter(
        'slope', '1/m', neutral=0.0, step=0.02 / half, low=-0.9 / half, high=0.9 / half
    )
    return [Candidate('wedge', (slope,))]


def phrase(values: Mapping[str, float]) -> str:
    """Say how the gap between the plates changes."""
    return f'the gap between the plates grows by {10 * values["slope"]:.0%} per 10 cm'


EFFECT = Effect(
    name='wedge',
    scope=Scope.RIG,
    parameters={'slope': Parameter(unit='1/m', low=-100.0, high=100.0)},
    on_physics=tilt,
    candidates=candidates,
    phrase=phrase,
    laboratory_check='measure the gap between the plates at both sides with a feeler gauge',
)
