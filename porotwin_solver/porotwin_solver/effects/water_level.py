"""The water beyond open sides stands higher than `rig.yaml` says; only differences matter."""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.basis.units import conductivity_of
from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import SIDES, Rig, SideName
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import direction

LARGEST_STEP = 0.1
"""Largest natural step of a rise, relative to the height of the rig. In clay even a high head moves
no front."""

PLACES = {
    'top': 'at the top',
    'bottom': 'at the bottom',
    'left': 'on the left',
    'right': 'on the right',
}
"""Where the water beyond a side stands, in words."""


def raise_water(physics: Physics, values: Values) -> Physics:
    """Return `physics` with higher water beyond some sides.

    Raises:
        InputError: one of these sides is closed, or the only open one.
    """
    raised = physics.boundaries.with_water_raised(_rises(values), others=bool(physics.water))
    return replace(physics, boundaries=raised)


def with_true_levels(rig: Rig) -> Rig:
    """Return `rig` with the heads that its effects `water_level` make.

    Raises:
        InputError: one of them has a wrong parameter, or raises the water beyond a closed side.
    """
    boundaries = rig.boundaries
    for described in rig.effects:
        if described.name == EFFECT.name:
            rises = _rises(EFFECT.checked(described.parameters))
            boundaries = boundaries.with_water_raised(rises, others=bool(rig.water))
    return rig.model_copy(update={'boundaries': boundaries})


def _rises(values: Values) -> dict[SideName, float]:
    return {side: values[side] for side in SIDES}


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the rises beyond all open sides, but one where no other water has a level."""
    rig = context.rig
    others = any(body.head_m is not None for body in rig.water.values())
    fitted = rig.boundaries.open_sides[: None if others else -1]
    limit = min(context.rig.height_m, MOST_DISTANCE)
    rises = (
        FitParameter(side, 'm', 0.0, level_step(context, side), -limit, limit) for side in fitted
    )
    return [Candidate('water_level', tuple(rises))] if fitted else []


def level_step(context: SearchContext, side: SideName) -> float:
    """Return the rise [m] that drives fronts one cell further through the rig."""
    rig = context.rig
    length = rig.width_m if side in ('left', 'right') else rig.height_m
    conductivity = conductivity_of(context.permeability, rig.viscosity_pa_s, rig.density_kg_m3)
    flux = context.front_speed * context.porosity
    return min(flux * length / conductivity, LARGEST_STEP * rig.height_m)


def phrase(values: Values) -> str:
    """Say on which sides the water level is higher or lower."""
    changed = sorted(
        (side for side in SIDES if values.get(side)), key=lambda side: -abs(values[side])
    )
    if not changed:
        return 'the water levels at all open sides are as described'
    levels = [f'{direction(values[side], "higher", "lower")} {PLACES[side]}' for side in changed]
    return (
        f'the water level is {" and ".join(levels)} than described, compared with the other open '
        'sides'
    )


EFFECT = Effect(
    name='water_level',
    order=135,
    scope=Scope.RIG,
    parameters={
        side: Parameter(
            unit='m',
            low=-MOST_DISTANCE,
            high=MOST_DISTANCE,
            default=0.0,
            vector='rise',
        )
        for side in SIDES
    },
    on_physics=raise_water,
    candidates=candidates,
    phrase=phrase,
    plainly='water stands higher or lower beyond an open side than described',
    laboratory_check='measure the water levels beyond all open sides from one horizontal line',
)
