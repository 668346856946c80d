"""The water beyond open sides stands higher than `rig.yaml` says; only differences matter."""

from dataclasses import replace

from porotwin_core.model.effect_limits import MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_core.rig import SIDES, SideName
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def raise_water(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with higher water beyond some sides.

    Raises:
        InputError: one of these sides is closed, or the only open one.
    """
    rises: dict[SideName, float] = {side: values[side] for side in SIDES}
    raised = rig.boundaries.with_water_raised(rises, others=bool(rig.water))
    return replace(rig, boundaries=raised)


EFFECT = AssetEffect(
    name='water_level',
    order=135,
    parameters={
        side: Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0)
        for side in SIDES
    },
    on_rig=raise_water,
    is_repeatable=True,
)
