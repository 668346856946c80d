"""Sealed cases: an experiment on the virtual rig whose effect nobody tells the diagnosis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from porotwin_core.rig import Boundaries, EffectDescription, Rig, Well
from porotwin_core.units import MOLECULAR_DIFFUSION, from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate

Draw = Callable[[Generator, Rig, tuple[str, ...]], dict[str, float | str]]

SMALL = Rig(
    name='small',
    width_m=0.934,
    height_m=0.562,
    depth_m=0.010,
    porosity=0.375,
    permeability_m2=6.57e-10,
    viscosity_pa_s=1.0e-3,
    density_kg_m3=998.0,
    boundaries=Boundaries(),
    wells={
        'injector': Well(x_m=0.235, z_m=0.235),
        'producer': Well(x_m=0.660, z_m=0.160),
        'control1': Well(x_m=0.120, z_m=0.420),
        'control2': Well(x_m=0.500, z_m=0.375),
        'control3': Well(x_m=0.760, z_m=0.460),
    },
)
"""The paper's small rig, as its owner believes it to be."""


@dataclass(frozen=True)
class BlindCase:
    """What is sealed: the effects, and the answers that count as right."""

    name: str
    kind: str
    effects: tuple[EffectDescription, ...]
    right: tuple[str, ...]
    schedule: Schedule
    duration: float
    photo_interval: float
    seed: int
    withheld: tuple[str, ...] = ()


def _log(generator: Generator, low: float, high: float) -> float:
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _sign(generator: Generator) -> float:
    return 1.0 if generator.random() < 0.5 else -1.0


def _off(generator: Generator, low: float, high: float) -> float:
    """Return a factor that is off 1 by `low` to `high`, up or down."""
    return 1.0 + _sign(generator) * _log(generator, low, high)


def _place(generator: Generator, rig: Rig) -> tuple[float, float]:
    """Return a place beside the injector, where tracer will pass."""
    well = rig.wells['injector']
    angle, distance = generator.uniform(0, 2 * np.pi), generator.uniform(0.07, 0.16)
    x = float(np.clip(well.x_m + distance * np.cos(angle), 0.05, rig.width_m - 0.05))
    z = float(np.clip(well.z_m + distance * np.sin(angle), 0.05, rig.height_m - 0.05))
    return x, z


def _zone(generator: Generator, rig: Rig, _wells: tuple[str, ...]) -> dict[str, float | str]:
    x, z = _place(generator, rig)
    factor = _log(generator, 0.03, 0.3) if generator.random() < 0.6 else _log(generator, 4, 20)
    radius = float(generator.uniform(0.035, 0.07))
    return {'x': x, 'z': z, 'radius': radius, 'permeability_factor': factor}


def _leak(generator: Generator, rig: Rig, _wells: tuple[str, ...]) -> dict[str, float | str]:
    x, z = _place(generator, rig)
    return {'x': x, 'z': z, 'rate': _sign(generator) * _log(generator, 25, 70)}


LIBRARY: Mapping[str, Draw] = {
    'dispersion': lambda g, _r, _w: {
        'longitudinal_dispersivity': (along := _log(g, 1.5e-3, 8e-3)),
        'transverse_dispersivity': along * _log(g, 0.05, 0.2),
        'diffusion': MOLECULAR_DIFFUSION,
    },
    'buoyancy': lambda g, _r, _w: {'density_difference': _sign(g) * _log(g, 0.3, 1.0)},
    'viscosity': lambda g, _r, _w: {'viscosity_ratio': _log(g, 1.25, 2.0) ** _sign(g)},
    'retardation': lambda g, _r, _w: {'retardation_factor': 1.0 + _log(g, 0.02, 0.12)},
    'decay': lambda g, _r, _w: {'rate': _log(g, 3e-5, 1.5e-4)},
    'dual_porosity': lambda g, _r, _w: {
        'immobile_fraction': _log(g, 0.05, 0.2),
        'exchange_rate': _log(g, 1e-4, 5e-4),
    },
    'heterogeneity': _zone,
    'porosity': lambda g, _r, _w: {'factor': _off(g, 0.03, 0.15)},
    'depth': lambda g, _r, _w: {'factor_centre': _off(g, 0.04, 0.15)},
    'rate': lambda g, _r, _w: {'well': 'injector', 'factor': _off(g, 0.03, 0.12)},
    'well_position': lambda g, _r, _w: {
        'well': 'injector',
        'dx': _sign(g) * _log(g, 2e-3, 1e-2),
        'dz': _sign(g) * _log(g, 2e-3, 1e-2),
    },
    'leak': _leak,
    'background_flow': lambda g, _r, _w: {
        'x_velocity': _sign(g) * _log(g, 5e-7, 2e-6),
        'z_velocity': _sign(g) * _log(g, 1e-7, 2e-6),
    },
    'saturation': lambda g, _r, _w: {'exponent': _log(g, 1.4, 2.0) ** _sign(g)},
    'illumination': lambda g, _r, _w: {
        'drift': -_log(g, 3e-5, 1e-4),
        'gradient': _sign(g) * _log(g, 0.05, 0.3),
    },
    'registration': lambda g, _r, _w: {
        'dx': _sign(g) * _log(g, 2e-3, 1e-2),
        'dz': _sign(g) * _log(g, 2e-3, 1e-2),
        'rotation': float(g.uniform(-0.015, 0.015)),
        'scale': float(1.0 + g.uniform(-0.015, 0.015)),
    },
    'clock': lambda g, _r, _w: {'offset': _sign(g) * _log(g, 60, 400)},
}
"""Effects of the library with strengths that leave a gap of about 0.1 to 0.35."""

OUTSIDE: Mapping[str, Draw] = {
    'streak': lambda g, r, _w: {
        'x': (place := _place(g, r))[0] - 0.04,
        'z': place[1] - 0.08,
        'x_end': place[0] + 0.04,
        'z_end': place[1] + 0.08,
        'width': 0.006,
        'permeability_factor': 0.01,
    },
    'pump_drift': lambda g, _r, _w: {'well': 'injector', 'drift': -_log(g, 8e-5, 2e-4)},
    'freundlich': lambda g, _r, _w: {'capacity': _log(g, 0.1, 0.3), 'exponent': 0.5},
    'settling': lambda g, _r, _w: {'velocity': _log(g, 8e-6, 2.5e-5)},
    'reflection': lambda _g, r, _w: {
        'x': r.wells['injector'].x_m + 0.1,
        'z': 0.15,
        'radius': 0.04,
        'strength': 0.3,
        'climb': 5e-5,
    },
    'stain': lambda g, _r, _w: {'delay': _log(g, 200, 600)},
}
"""Effects that no library names; the right answer is `unexplained`."""

PAIRS = (
    ('rate', 'saturation'),
    ('buoyancy', 'dispersion'),
    ('porosity', 'illumination'),
    ('registration', 'decay'),
    ('heterogeneity', 'saturation'),
)

SAME_OUTSIDE = {'settling': ('background_flow',), 'freundlich': ('retardation', 'porosity')}
"""Effects outside the library that one inside it equals: what sinks evenly drifts evenly, and a
sharp front of constant concentration sorbs as if by a straight line."""

SAME = {'retardation': ('retardation', 'porosity')}
"""Effects whose other name counts as right: for constant porosity they are one product."""


def draw_case(number: int, seed: int) -> BlindCase:
    """Return case `number` of the check with `seed`: kinds take turns, the rest is drawn."""
    generator = np.random.default_rng([seed, number])
    schedule, duration, wells = _schedule(generator)
    turn = number % 10
    effects: tuple[EffectDescription, ...] = ()
    withheld: tuple[str, ...] = ()
    right: tuple[str, ...] = ('unexplained',)
    if turn == 0:
        kind, right = 'none', ('none',)
    elif turn == 1:
        kind = 'outside'
        name = list(OUTSIDE)[int(generator.integers(len(OUTSIDE)))]
        effects = (_described(name, OUTSIDE[name], generator, wells),)
        right = ('unexplained', *SAME_OUTSIDE.get(name, ()))
    elif turn == 2:
        kind = 'left out'
        names = ('heterogeneity', 'clock', 'viscosity', 'illumination', 'buoyancy')
        name = names[(number // 10) % len(names)]
        effects, withheld = (_described(name, LIBRARY[name], generator, wells),), (name,)
    elif turn in (3, 4):
        kind = 'pair'
        pair = PAIRS[int(generator.integers(len(PAIRS)))]
        effects = tuple(_described(name, LIBRARY[name], generator, wells) for name in pair)
        right = pair
    else:
        kind = 'single'
        name = list(LIBRARY)[int(generator.integers(len(LIBRARY)))]
        effects = (_described(name, LIBRARY[name], generator, wells),)
        right = SAME.get(name, (name,))
        if name == 'porosity' and float(effects[0].parameters['factor']) > 1:
            right = ('porosity', 'retardation')
    return BlindCase(
        name=f'case_{number:03d}',
        kind=kind,
        effects=effects,
        right=right,
        schedule=schedule,
        duration=duration,
        photo_interval=60.0,
        seed=int(generator.integers(2**31)),
        withheld=withheld,
    )


def _described(
    name: str, draw: Draw, generator: Generator, wells: tuple[str, ...]
) -> EffectDescription:
    return EffectDescription(name=name, parameters=draw(generator, SMALL, wells))


def _schedule(generator: Generator) -> tuple[Schedule, float, tuple[str, ...]]:
    """Return what the pumps are told: injection, pauses or a chase, one or two control wells."""
    duration = float(60 * generator.integers(45, 75))
    injected = float(generator.uniform(350, 520))
    style = generator.choice(['paper', 'pulses', 'chase', 'rest'])
    controls = list(generator.choice(['control1', 'control2', 'control3'], 2, replace=False))
    rows: list[ScheduleRow] = []

    def tell(time: float, well: str, rate_ml_h: float, concentration: float = 0.0) -> None:
        rows.append(ScheduleRow(time, well, WellRate(from_ml_h(rate_ml_h), concentration)))

    tell(0.0, 'injector', injected, 1.0)
    parts = np.sort(generator.uniform(0.2, 0.9, 3)) * duration
    for time in (0.0, *(float(part) for part in parts)):
        shares = generator.uniform(0, 250, 2)
        for well, rate in zip(controls, shares, strict=True):
            tell(time, str(well), float(rate))
        tell(time, 'producer', -float(shares.sum()) - injected * float(generator.uniform(0.3, 1)))
    if style == 'pulses':
        for index in range(2):
            tell(duration * (0.25 + 0.35 * index), 'injector', 0.0, 1.0)
            tell(duration * (0.35 + 0.35 * index), 'injector', injected, 1.0)
    elif style == 'chase':
        tell(duration * float(generator.uniform(0.4, 0.6)), 'injector', injected, 0.0)
    elif style == 'rest':
        stop = duration * float(generator.uniform(0.5, 0.65))
        rows = [row for row in rows if row.time < stop]
        for well in ('injector', 'producer', *controls):
            tell(stop, str(well), 0.0, 0.0)
    return Schedule(tuple(rows)), duration, ('injector', *map(str, controls))
