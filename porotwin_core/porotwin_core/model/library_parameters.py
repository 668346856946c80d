"""The parameters of the effects that the model and the virtual rig both have."""

from collections.abc import Mapping

from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MOLECULAR_DIFFUSION
from porotwin_core.model.effect_limits import (
    LEAST_RADIUS,
    MOST_CHANGE,
    MOST_DENSITY_DIFFERENCE,
    MOST_DIFFUSION,
    MOST_DISTANCE,
    MOST_FACTOR,
    MOST_IMMOBILE,
    MOST_LEAK_ML_H,
    MOST_LIGHT_GRADIENT,
    MOST_PERMEABILITY_FACTOR,
    MOST_RETARDATION,
    MOST_ROTATION,
    MOST_TUBE_ML,
    MOST_VELOCITY,
    MOST_VISCOSITY_RATIO,
)
from porotwin_core.model.effect_parameter import ONSET, Parameter, Reading
from porotwin_core.rig import SIDES

PARAMETERS: Mapping[str, Mapping[str, Parameter]] = {
    'background_flow': {
        'x_velocity': Parameter(
            unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0, vector='velocity'
        ),
        'z_velocity': Parameter(
            unit='m/s', low=-MOST_VELOCITY, high=MOST_VELOCITY, default=0.0, vector='velocity'
        ),
    },
    'buoyancy': {
        'density_difference': Parameter(
            unit='kg/m3', low=-MOST_DENSITY_DIFFERENCE, high=MOST_DENSITY_DIFFERENCE
        )
    },
    'clock': {'offset': Parameter(unit='s', low=-LONGEST_EXPERIMENT_S, high=LONGEST_EXPERIMENT_S)},
    'dead_volume': {
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'volume': Parameter(unit='ml', low=0.0, high=MOST_TUBE_ML),
    },
    'decay': {'rate': Parameter(unit='1/s', low=0.0, high=MOST_CHANGE)},
    'depth': {
        'factor_centre': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    'dispersion': {
        'longitudinal_dispersivity': Parameter(
            unit='m', low=0.0, high=MOST_DISTANCE, may_be_fixed=True
        ),
        'transverse_dispersivity': Parameter(
            unit='m', low=0.0, high=MOST_DISTANCE, may_be_fixed=True
        ),
        'diffusion': Parameter(
            unit='m2/s',
            low=0.0,
            high=MOST_DIFFUSION,
            default=MOLECULAR_DIFFUSION,
            may_be_fixed=True,
            is_scored=False,
        ),
    },
    'dual_porosity': {
        'immobile_fraction': Parameter(
            unit='-', low=0.0, high=MOST_IMMOBILE, reading=Reading(100.0, '%')
        ),
        'exchange_rate': Parameter(
            unit='1/s', low=0.0, high=MOST_CHANGE, reading=Reading(3600.0, 'per hour')
        ),
    },
    'fringe': {'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE)},
    'heterogeneity': {
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'radius': Parameter(unit='m', low=LEAST_RADIUS, high=MOST_DISTANCE, is_scored=False),
        'permeability_factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
            is_logarithmic=True,
        ),
    },
    'illumination': {
        'level': Parameter(
            unit='-', low=-1.0, high=MOST_FACTOR, default=0.0, reading=Reading(100.0, '%')
        ),
        'drift': Parameter(unit='1/s', low=-MOST_CHANGE, high=MOST_CHANGE, default=0.0),
        'gradient': Parameter(
            unit='1/m', low=-MOST_LIGHT_GRADIENT, high=MOST_LIGHT_GRADIENT, default=0.0
        ),
        'since': ONSET,
    },
    'leak': {
        'x': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'z': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, is_scored=False),
        'rate': Parameter(unit='ml/h', low=-MOST_LEAK_ML_H, high=MOST_LEAK_ML_H),
    },
    'permeability': {
        'factor': Parameter(
            unit='-',
            low=1.0 / MOST_PERMEABILITY_FACTOR,
            high=MOST_PERMEABILITY_FACTOR,
            neutral=1.0,
            is_logarithmic=True,
        )
    },
    'porosity': {
        'factor': Parameter(unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0)
    },
    'rate': {
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, neutral=1.0),
        'since': ONSET,
    },
    'registration': {
        'dx': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'dz': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'rotation': Parameter(
            unit='rad', low=-MOST_ROTATION, high=MOST_ROTATION, default=0.0, is_scored=False
        ),
        'scale': Parameter(
            unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, default=1.0, neutral=1.0
        ),
        'since': ONSET,
    },
    'retardation': {
        'retardation_factor': Parameter(unit='-', low=1.0, high=MOST_RETARDATION, neutral=1.0)
    },
    'saturation': {
        'exponent': Parameter(
            unit='-', low=1.0 / MOST_FACTOR, high=MOST_FACTOR, neutral=1.0, reading=Reading(1.0, '')
        ),
    },
    'stock_strength': {
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'factor': Parameter(unit='-', low=0.0, high=1.0, neutral=1.0),
        'since': ONSET,
    },
    'viscosity': {
        'viscosity_ratio': Parameter(
            unit='-', low=1.0 / MOST_VISCOSITY_RATIO, high=MOST_VISCOSITY_RATIO, neutral=1.0
        )
    },
    'water_body': {
        'body': Parameter(unit='name', is_name=True, is_scored=False),
        'rise': Parameter(unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0),
        'factor': Parameter(unit='-', low=0.0, high=MOST_FACTOR, default=1.0, neutral=1.0),
    },
    'water_level': {
        side: Parameter(
            unit='m',
            low=-MOST_DISTANCE,
            high=MOST_DISTANCE,
            default=0.0,
            vector='rise',
        )
        for side in SIDES
    },
    'well_position': {
        'well': Parameter(unit='name', is_name=True, is_scored=False),
        'dx': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
        'dz': Parameter(
            unit='m', low=-MOST_DISTANCE, high=MOST_DISTANCE, default=0.0, vector='displacement'
        ),
    },
}
