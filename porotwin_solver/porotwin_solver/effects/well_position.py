"""A well opens elsewhere than nominal."""

from dataclasses import replace

from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _move(physics: Physics, values: Values) -> Physics:
    name = physics.well(values['well'])
    nominal = physics.wells[name]
    moved = replace(nominal, x=nominal.x + values['dx'], z=nominal.z + values['dz'])
    return replace(physics, wells={**physics.wells, name: moved})


EFFECT = Effect(
    'well_position',
    {
        'well': Parameter('name', is_name=True),
        'dx': Parameter('m', default=0.0),
        'dz': Parameter('m', default=0.0),
    },
    on_physics=_move,
)
