"""The photograph stamped t shows the rig at pump time t + offset."""

from dataclasses import replace

from porotwin_core.basis.units import LONGEST_EXPERIMENT_S
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with a larger clock offset."""
    return replace(rig, clock_offset=rig.clock_offset + values['offset'])


EFFECT = AssetEffect(
    name='clock',
    order=170,
    parameters={
        'offset': Parameter(unit='s', low=-LONGEST_EXPERIMENT_S, high=LONGEST_EXPERIMENT_S),
    },
    on_rig=change,
    needs_recording=True,
    is_repeatable=True,
)
