"""The tracer spreads: D = diffusion + Scheidegger's tensor in the pore velocity."""

from dataclasses import replace

from porotwin_core.basis.units import MOLECULAR_DIFFUSION
from porotwin_core.model.effect_limits import MOST_DIFFUSION, MOST_DISTANCE
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect
from porotwin_rig.true_rig import TrueRig


def change(rig: TrueRig, values: Values) -> TrueRig:
    """Return `rig` with these coefficients of spreading."""
    return replace(
        rig,
        longitudinal_dispersivity=values['longitudinal_dispersivity'],
        transverse_dispersivity=values['transverse_dispersivity'],
        diffusion=values['diffusion'],
    )


EFFECT = AssetEffect(
    name='dispersion',
    order=10,
    parameters={
        'longitudinal_dispersivity': Parameter(unit='m', low=0.0, high=MOST_DISTANCE),
        'transverse_dispersivity': Parameter(unit='m', low=0.0, high=MOST_DISTANCE),
        'diffusion': Parameter(
            unit='m2/s',
            low=0.0,
            high=MOST_DIFFUSION,
            default=MOLECULAR_DIFFUSION,
        ),
    },
    on_rig=change,
    longest_step=7.5,
)
