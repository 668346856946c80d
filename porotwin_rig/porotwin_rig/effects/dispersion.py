"""The tracer spreads: D = diffusion + Scheidegger's tensor in the pore velocity."""

from dataclasses import replace

from porotwin_core.model.effect_parameter import Values
from porotwin_core.model.library_parameters import PARAMETERS
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
    parameters=PARAMETERS['dispersion'],
    on_rig=change,
    longest_step=7.5,
)
