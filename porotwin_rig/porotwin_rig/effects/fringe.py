"""Capillarity fills the sand above the water table to another height than described."""

from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def raise_fringe(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another height of the fringe, never below zero.

    Raises:
        InputError: the sand is full of water.
    """
    if rig.fringe is None:
        raise InputError('fringe: the sand is full of water; give water_table in rig.yaml')
    return replace(rig, fringe=max(rig.fringe + values['rise'], 0.0))


EFFECT = AssetEffect(
    name='fringe',
    order=137,
    parameters={'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE)},
    on_rig=raise_fringe,
    is_repeatable=True,
)
