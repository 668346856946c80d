"""The level or the rate of one water body of `rig.yaml` differs from the described one."""

from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_limits import MOST_DISTANCE, MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another level or rate of the body.

    Raises:
        InputError: the rig has no such body.
    """
    name = values['body']
    if name not in rig.water:
        known = ', '.join(rig.water) or 'none'
        raise InputError(f"water_body: no water '{name}' in rig.yaml; known: {known}")
    body = rig.water[name].with_change(values['rise'], values['factor'])
    return replace(rig, water={**rig.water, name: body})


EFFECT = AssetEffect(
    name='water_body',
    order=136,
    parameters={
        'body': Parameter(unit='name', is_name=True),
        'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, default=1.0, neutral=1.0),
    },
    on_rig=change,
    is_repeatable=True,
)
