"""The level or the rate of one water body of `rig.yaml` differs from the described one."""

from dataclasses import replace

from porotwin_core.basis.errors import InputError
from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
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
    parameters=PARAMETERS['water_body'],
    on_rig=change,
    is_repeatable=True,
)
