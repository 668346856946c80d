"""Capillarity fills the sand above the water table to another height than described."""

from collections.abc import Sequence
from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope
from porotwin_solver.effects.definition.words import direction


def raise_fringe(physics: Physics, values: Values) -> Physics:
    """Return `physics` with another height of the fringe, never below zero.

    Raises:
        InputError: the sand is full of water.
    """
    if physics.fringe is None:
        raise InputError('fringe: the sand is full of water; give water_table in rig.yaml')
    return replace(physics, fringe=max(physics.fringe + values['rise'], 0.0))


def candidates(context: SearchContext) -> Sequence[Candidate]:
    """Fit the height in steps of a cell, where there is a table."""
    table = context.rig.water_table
    if table is None:
        return []
    rise = FitParameter('rise', 'm', 0.0, context.grid.dz, -table.fringe_m, context.rig.height_m)
    return [Candidate('fringe', (rise,))]


def phrase(values: Values) -> str:
    """Say by how much the height differs."""
    rise = direction(values['rise'], 'higher', 'lower')
    return f'capillarity fills the sand {rise} than described'


EFFECT = Effect(
    name='fringe',
    order=137,
    scope=Scope.RIG,
    parameters={'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE)},
    on_physics=raise_fringe,
    candidates=candidates,
    phrase=phrase,
    plainly='the wet sand above the water table is higher or lower than described',
    laboratory_check='measure from the water level to the upper edge of the dark, wet sand',
)
