"""Every effect with parameters of a plausible size, for tests of the whole model."""

from porotwin_core.rig import EffectDescription
from porotwin_solver.effects import EFFECTS

EXAMPLES = {
    'numerical_diffusion': {'model_diffusion': 1e-7},
    'dispersion': {
        'longitudinal_dispersivity': 0.005,
        'transverse_dispersivity': 0.0004,
        'diffusion': 2e-9,
    },
    'buoyancy': {'density_difference': 0.8},
    'viscosity': {'viscosity_ratio': 1.4},
    'retardation': {'retardation_factor': 1.2},
    'decay': {'rate': 1e-4},
    'dual_porosity': {'immobile_fraction': 0.1, 'exchange_rate': 4e-4},
    'heterogeneity': {'x': 0.3, 'z': 0.3, 'radius': 0.07, 'permeability_factor': 0.02},
    'porosity': {'factor': 0.9},
    'depth': {'factor_centre': 1.1},
    'rate': {'well': 'injector', 'factor': 0.95},
    'well_position': {'well': 'injector', 'dx': 0.004, 'dz': -0.003},
    'leak': {'x': 0.4, 'z': 0.3, 'rate': -40.0},
    'background_flow': {'x_velocity': 1e-6, 'z_velocity': 4e-7},
    'saturation': {'exponent': 1.5},
    'illumination': {'drift': -5e-5, 'gradient': 0.1},
    'registration': {'dx': 0.004, 'dz': -0.01, 'rotation': 0.01, 'scale': 1.01},
    'clock': {'offset': 100.0},
}
"""Parameters of every effect of the diagnosis contract."""

PHYSICAL = [name for name in EXAMPLES if EFFECTS[name].on_physics is not None]
"""The effects that change flow or transport, not the picture."""


def described(name: str) -> EffectDescription:
    """Return an effect with the parameters of EXAMPLES."""
    return EffectDescription(name=name, parameters=EXAMPLES[name])
