"""Effects as the blind check draws them: strengths that leave a gap of about 0.1 to 0.35.

Strengths follow the rig's size and the recording's length, so that an effect shows as clearly on a
large rig over hours as on a small one within one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from porotwin_core.rig import EffectDescription, Rig, Well
from porotwin_core.units import GRAVITY, MOLECULAR_DIFFUSION

Parameters = dict[str, float | str]


@dataclass(frozen=True)
class Stage:
    """Where effects are drawn: a rig, the wells that pump (the injector first), how long [s],
    and how much the injector is told to pump [ml/h] while it does."""

    rig: Rig
    wells: tuple[str, ...]
    duration: float
    injected_ml_h: float

    @property
    def size(self) -> float:
        """Length of the rig relative to the paper's small one."""
        return self.rig.width_m / 0.934

    @property
    def injector(self) -> Well:
        """The well that brings the tracer."""
        return self.rig.wells[self.wells[0]]

    @property
    def sinking(self) -> float:
        """Density difference [kg/m3] that moves tracer by one metre within the recording."""
        permeability = float(np.exp(np.mean(np.log(self.rig.nominal_map('permeability_m2')))))
        speed = permeability * GRAVITY / (self.rig.viscosity_pa_s * self.porosity)
        return 1.0 / (speed * self.duration)

    @property
    def porosity(self) -> float:
        """The mean porosity."""
        return float(np.mean(self.rig.nominal_map('porosity')))


Draw = Callable[[Generator, Stage], Parameters]


def _log(generator: Generator, low: float, high: float) -> float:
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _sign(generator: Generator) -> float:
    return 1.0 if generator.random() < 0.5 else -1.0


def _off(generator: Generator, low: float, high: float) -> float:
    """Return a factor that is off 1 by `low` to `high`, up or down."""
    return 1.0 + _sign(generator) * _log(generator, low, high)


def _shift(generator: Generator, stage: Stage) -> Parameters:
    """Return how far something is off its place: 1.5 to 6 mm each way on the small rig."""
    return {
        axis: _sign(generator) * _log(generator, 1.5e-3, 6e-3) * stage.size for axis in ('dx', 'dz')
    }


def _place(generator: Generator, stage: Stage) -> tuple[float, float]:
    """Return a place [m] beside the injector, where tracer will pass."""
    rig, well = stage.rig, stage.injector
    angle = generator.uniform(0, 2 * np.pi)
    distance = generator.uniform(0.07, 0.16) * stage.size
    edge = 0.05 * stage.size
    x = float(np.clip(well.x_m + distance * np.cos(angle), edge, rig.width_m - edge))
    z = float(np.clip(well.z_m + distance * np.sin(angle), edge, rig.height_m - edge))
    return x, z


def _zone(generator: Generator, stage: Stage) -> Parameters:
    x, z = _place(generator, stage)
    factor = _log(generator, 0.05, 0.4) if generator.random() < 0.6 else _log(generator, 3, 12)
    radius = float(generator.uniform(0.03, 0.06)) * stage.size
    return {'x': x, 'z': z, 'radius': radius, 'permeability_factor': factor}


def _leak(generator: Generator, stage: Stage) -> Parameters:
    x, z = _place(generator, stage)
    rate = _sign(generator) * _log(generator, 0.04, 0.1) * stage.injected_ml_h
    return {'x': x, 'z': z, 'rate': rate}


def _dispersion(generator: Generator, stage: Stage) -> Parameters:
    along = _log(generator, 6e-4, 4e-3) * stage.size
    return {
        'longitudinal_dispersivity': along,
        'transverse_dispersivity': along * _log(generator, 0.05, 0.2),
        'diffusion': MOLECULAR_DIFFUSION,
    }


def _background_flow(generator: Generator, stage: Stage) -> Parameters:
    unit = stage.size * stage.porosity / stage.duration
    return {
        'x_velocity': _sign(generator) * _log(generator, 4e-3, 1.5e-2) * unit,
        'z_velocity': _sign(generator) * _log(generator, 1e-3, 1.5e-2) * unit,
    }


def _streak(generator: Generator, stage: Stage) -> Parameters:
    x, z = _place(generator, stage)
    size = stage.size
    return {
        'x': x - 0.04 * size,
        'z': z - 0.08 * size,
        'x_end': x + 0.04 * size,
        'z_end': z + 0.08 * size,
        'width': 0.006 * size,
        'permeability_factor': _log(generator, 0.03, 0.15),
    }


def _anisotropy(generator: Generator, stage: Stage) -> Parameters:
    middle = stage.injector.z_m
    half = generator.uniform(0.06, 0.1) * stage.size
    ratio = _log(generator, 1.25, 1.8) ** _sign(generator)
    return {'z_low': max(middle - half, 0.0), 'z_high': middle + half, 'ratio': ratio}


LIBRARY: Mapping[str, Draw] = {
    'dispersion': _dispersion,
    'buoyancy': lambda g, s: {
        'density_difference': _sign(g) * _log(g, 0.02, 0.065) * s.size * s.sinking
    },
    'viscosity': lambda g, _s: {'viscosity_ratio': _log(g, 1.2, 1.7) ** _sign(g)},
    'retardation': lambda g, _s: {'retardation_factor': 1.0 + _log(g, 0.015, 0.08)},
    'decay': lambda g, s: {'rate': _log(g, 0.12, 0.5) / s.duration},
    'dual_porosity': lambda g, s: {
        'immobile_fraction': _log(g, 0.025, 0.1),
        'exchange_rate': _log(g, 0.4, 1.8) / s.duration,
    },
    'heterogeneity': _zone,
    'porosity': lambda g, _s: {'factor': _off(g, 0.02, 0.1)},
    'depth': lambda g, _s: {'factor_centre': _off(g, 0.04, 0.15)},
    'rate': lambda g, s: {'well': s.wells[0], 'factor': _off(g, 0.025, 0.09)},
    'well_position': lambda g, s: {'well': s.wells[0], **_shift(g, s)},
    'leak': _leak,
    'background_flow': _background_flow,
    'saturation': lambda g, _s: {'exponent': _log(g, 1.4, 2.0) ** _sign(g)},
    'illumination': lambda g, s: {
        'drift': -_log(g, 0.08, 0.3) / s.duration,
        'gradient': _sign(g) * _log(g, 0.05, 0.3) / s.size,
    },
    'registration': lambda g, s: {
        **_shift(g, s),
        'rotation': float(g.uniform(-0.015, 0.015)),
        'scale': float(1.0 + g.uniform(-0.015, 0.015)),
    },
    'clock': lambda g, s: {'offset': _sign(g) * _log(g, 0.012, 0.07) * s.duration},
}
"""Effects of the diagnosis contract."""

OUTSIDE: Mapping[str, Draw] = {
    'streak': _streak,
    'pump_drift': lambda g, s: {'well': s.wells[0], 'drift': -_log(g, 0.06, 0.2) / s.duration},
    'freundlich': lambda g, _s: {'capacity': _log(g, 0.02, 0.08), 'exponent': 0.5},
    'anisotropy': _anisotropy,
    'stain': lambda g, s: {'delay': _log(g, 0.05, 0.16) * s.duration},
    'water_table': lambda g, s: {
        'amplitude': _log(g, 1e-3, 2.5e-3),
        'period': _log(g, 0.5, 1.2) * s.duration,
    },
    'reflection': lambda g, s: {
        'x': s.injector.x_m + 0.2 * s.size,
        'z': max(s.injector.z_m - 0.08 * s.size, 0.0),
        'radius': 0.04 * s.size,
        'strength': _log(g, 0.4, 0.8),
        'climb': 0.2 * s.size / s.duration,
    },
    'settling': lambda g, s: {'velocity': _log(g, 0.01, 0.03) * s.size / s.duration},
    'pulsation': lambda g, s: {
        'well': s.wells[0],
        'amplitude': _log(g, 0.2, 0.5),
        'period': _log(g, 0.4, 0.8) * s.duration,
    },
}
"""Effects that no library names; the right answer is `unexplained`."""

KINDRED = (
    frozenset({'rate', 'porosity', 'depth', 'retardation', 'dual_porosity', 'clock', 'leak'}),
    frozenset({'decay', 'illumination', 'saturation'}),
    frozenset({'registration', 'well_position', 'background_flow'}),
    frozenset({'buoyancy', 'viscosity', 'heterogeneity'}),
    frozenset({'dispersion'}),
)
"""Effects that show in like ways; a pair is drawn from two of these groups."""

SAME_OUTSIDE = {'settling': ('background_flow',), 'freundlich': ('retardation', 'porosity')}
"""Effects outside the library that one inside it equals: what sinks evenly drifts evenly, and a
sharp front of constant concentration sorbs as if by a straight line."""


def drawn(name: str, generator: Generator, stage: Stage) -> EffectDescription:
    """Return the effect `name` with parameters that `generator` draws for `stage`."""
    draw = {**LIBRARY, **OUTSIDE}[name]
    return EffectDescription(name=name, parameters=draw(generator, stage))


def equal_names(effect: EffectDescription) -> tuple[str, ...]:
    """Return the names that are right for `effect`: where porosity is constant, its product with
    the retardation factor is all that shows."""
    more = effect.name == 'retardation' or (
        effect.name == 'porosity' and float(effect.parameters['factor']) > 1
    )
    return ('retardation', 'porosity') if more else (effect.name,)
