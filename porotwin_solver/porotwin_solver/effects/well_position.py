"""A well opens at another place than the nominal one, by (dx, dz)."""

from collections.abc import Sequence
from dataclasses import replace

from numpy.random import Generator

from porotwin_core.model.blind_draw import DrawContext, DrawnValues, displacement
from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Appearance, Effect, Scope
from porotwin_solver.effects.definition.words import direction

STEP_CELLS = 0.5
"""Natural step in cells of the recording. The screening cells are twice as large."""


def move(physics: Physics, values: Values) -> Physics:
    """Return `physics` with the well displaced."""
    name = physics.well(values['well'])
    nominal = physics.wells[name]
    moved = replace(nominal, x=nominal.x + values['dx'], z=nominal.z + values['dz'])
    return replace(physics, wells={**physics.wells, name: moved})


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the displacement of a pumping well, which stays inside the rig."""
    rig, well = context.rig, context.rig.wells[context.well]
    margin = 2 * well.radius_m
    parameters = tuple(
        FitParameter(
            axis,
            'm',
            0.0,
            STEP_CELLS * context.grid.dx,
            min(0.0, margin - nominal),
            max(0.0, size - margin - nominal),
        )
        for axis, nominal, size in (('dx', well.x_m, rig.width_m), ('dz', well.z_m, rig.height_m))
    )
    return [Candidate('well_position', parameters, {'well': context.well})]


def phrase(values: Values) -> str:
    """Say where the well opens."""
    return (
        f'well {values["well"]} opens '
        f'{direction(values["dx"], "to the right of", "to the left of")} and '
        f'{direction(values["dz"], "above", "below")} its nominal place'
    )


def draw(generator: Generator, context: DrawContext) -> DrawnValues:
    """Draw an injector that opens 1.5 to 6 mm off, each way, on the small rig."""
    return {'well': context.wells[0], **displacement(generator, context)}


EFFECT = Effect(
    name='well_position',
    order=110,
    scope=Scope.WELL,
    parameters={
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'dx': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'dz': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
    },
    on_physics=move,
    candidates=candidates,
    phrase=phrase,
    plainly='a well opens at another place',
    laboratory_check='measure where the well opens',
    blind_draw=draw,
    appearance=Appearance.SHIFT,
)
