"""The plates bulge: the nominal depth at the sides, times factor_centre in the middle.

depth = nominal * (1 + (factor_centre - 1) (1 - ((x - W/2) / (W/2))^2)), a parabola in x.
"""

from porotwin_core.model.effect_limits import MOST_FACTOR
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray
from porotwin_rig.true_rig import TrueRig


def bulge(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with another depth."""
    half = 0.5 * rig.rig.width_m

    def factor(x: FloatArray, _z: FloatArray) -> FloatArray:
        return 1.0 + (values['factor_centre'] - 1.0) * (1.0 - ((x - half) / half) ** 2)

    return rig.with_depth_factor(factor)


EFFECT = AssetEffect(
    name='depth',
    order=90,
    parameters={
        'factor_centre': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    on_rig=bulge,
    is_repeatable=True,
)
