"""The tracer spreads: D = diffusion + Scheidegger's tensor in the pore velocity."""

from dataclasses import replace

from porotwin_core.units import MOLECULAR_DIFFUSION
from porotwin_solver.effects.effect import Effect, Parameter, Values
from porotwin_solver.physics import Physics


def _spread(physics: Physics, values: Values) -> Physics:
    return replace(
        physics,
        longitudinal_dispersivity=values['longitudinal_dispersivity'],
        transverse_dispersivity=values['transverse_dispersivity'],
        diffusion=values['diffusion'],
    )


EFFECT = Effect(
    'dispersion',
    {
        'longitudinal_dispersivity': Parameter('m', low=0.0),
        'transverse_dispersivity': Parameter('m', low=0.0),
        'diffusion': Parameter('m2/s', low=0.0, default=MOLECULAR_DIFFUSION),
    },
    on_physics=_spread,
)
