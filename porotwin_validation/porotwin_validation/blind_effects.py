"""Effects that the blind check draws: those of the library, and those that no library names."""

from collections.abc import Mapping

from numpy.random import Generator

from porotwin_core.blind_draw import (
    Draw,
    DrawContext,
    DrawnValues,
    log_uniform,
    place_near_injector,
    random_sign,
)
from porotwin_core.rig import EffectDescription
from porotwin_rig.effects import KNOWN
from porotwin_solver.effects import EFFECTS, effect
from porotwin_solver.effects.definition.effect import Appearance

LIBRARY: Mapping[str, Draw] = {
    name: found.blind_draw
    for name, found in EFFECTS.items()
    if found.blind_draw is not None and name in KNOWN
}
"""Draws of the effects that the diagnosis searches and the virtual rig has, in their order."""

PAIR_GROUPS: tuple[tuple[str, ...], ...] = tuple(
    names
    for appearance in Appearance
    if (names := tuple(sorted(n for n in LIBRARY if EFFECTS[n].appearance is appearance)))
)
"""Names of effects that show alike; a pair is drawn from two of these groups."""


def _streak(generator: Generator, context: DrawContext) -> DrawnValues:
    x, z = place_near_injector(generator, context)
    size = context.size
    return {
        'x': x - 0.04 * size,
        'z': z - 0.08 * size,
        'x_end': x + 0.04 * size,
        'z_end': z + 0.08 * size,
        'width': 0.006 * size,
        'permeability_factor': log_uniform(generator, 0.03, 0.15),
    }


def _anisotropy(generator: Generator, context: DrawContext) -> DrawnValues:
    middle = context.injector.z_m
    half = generator.uniform(0.06, 0.1) * context.size
    ratio = log_uniform(generator, 1.25, 1.8) ** random_sign(generator)
    return {'z_low': max(middle - half, 0.0), 'z_high': middle + half, 'ratio': ratio}


OUTSIDE: Mapping[str, Draw] = {
    'streak': _streak,
    'pump_drift': lambda g, s: {
        'well': s.wells[0],
        'drift': -log_uniform(g, 0.06, 0.2) / s.duration,
    },
    'freundlich': lambda g, _s: {'capacity': log_uniform(g, 0.02, 0.08), 'exponent': 0.5},
    'anisotropy': _anisotropy,
    'stain': lambda g, s: {'delay': log_uniform(g, 0.05, 0.16) * s.duration},
    'water_table': lambda g, s: {
        'amplitude': log_uniform(g, 1e-3, 2.5e-3),
        'period': log_uniform(g, 0.5, 1.2) * s.duration,
    },
    'reflection': lambda g, s: {
        'x': s.injector.x_m + 0.2 * s.size,
        'z': max(s.injector.z_m - 0.08 * s.size, 0.0),
        'radius': 0.04 * s.size,
        'strength': log_uniform(g, 0.4, 0.8),
        'climb': 0.2 * s.size / s.duration,
    },
    'settling': lambda g, s: {'velocity': log_uniform(g, 0.01, 0.03) * s.size / s.duration},
    'pulsation': lambda g, s: {
        'well': s.wells[0],
        'amplitude': log_uniform(g, 0.2, 0.5),
        'period': log_uniform(g, 0.4, 0.8) * s.duration,
    },
}
"""Draws of the effects that no library names; the right answer is `unexplained`."""

EQUAL_TO_OUTSIDE = {'settling': ('background_flow',), 'freundlich': ('retardation', 'porosity')}
"""Library effects that equal one outside: even settling is an even drift, and at a sharp front of
constant concentration nonlinear sorption acts like linear sorption."""


def drawn(name: str, generator: Generator, context: DrawContext) -> EffectDescription:
    """Return the effect `name` with random parameters for `context`."""
    draw = {**LIBRARY, **OUTSIDE}[name]
    return EffectDescription(name=name, parameters=draw(generator, context))


def equal_names(described: EffectDescription) -> tuple[str, ...]:
    """Return the names of the effects that no map can tell from `described`, its own included."""
    if described.name not in EFFECTS:
        return (described.name,)
    equal = {described.name, *effect(described.name).equal_to(described.parameters)}
    return tuple(name for name in EFFECTS if name in equal)
