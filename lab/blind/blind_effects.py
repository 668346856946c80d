"""Pairs of effects that the blind check draws, and effects that no map can tell apart."""

import math
from collections.abc import Mapping
from dataclasses import replace

from numpy.random import Generator

from porotwin_cli.running.drawn_effects import LIBRARY, drawn
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.rig import EffectDescription
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_solver.effects import EFFECTS, effect
from porotwin_solver.effects.definition.effect import Appearance

PAIR_GROUPS: tuple[tuple[str, ...], ...] = tuple(
    names
    for appearance in Appearance
    if (names := tuple(sorted(n for n in LIBRARY if EFFECTS[n].appearance is appearance)))
)
"""Names of effects that show alike; a pair is drawn from two of these groups."""


ALIKE = ('rate', 'leak', 'heterogeneity')
"""Effects that a rig may have twice: two wrong pumps, two leaks, two zones."""

LEAST_APART = 0.1
"""Distance of two leaks or zones [m] on the small rig; nearer ones act like one."""


def drawn_alike(
    name: str, generator: Generator, context: DrawContext, rates: Mapping[str, float]
) -> tuple[EffectDescription, EffectDescription]:
    """Return the effect `name` twice with random parameters: at two wells, or at two places.

    The second pump is wrong by as many ml/h as one that pumps like the injector would be.

    Args:
        name: one of `ALIKE`.
        generator: source of the parameters.
        context: rig and recording.
        rates: largest commanded rate of each well, in any one unit.
    """
    first = drawn(name, generator, context)
    if 'well' in first.parameters:
        injector, other = context.wells[:2]
        second = drawn(name, generator, replace(context, wells=(other,)))
        off = (float(second.parameters['factor']) - 1.0) * rates[injector] / rates[other]
        values = {**second.parameters, 'factor': 1.0 + max(off, -MOST_MISSING)}
        return first, EffectDescription(name=name, parameters=values)
    while True:
        second = drawn(name, generator, context)
        apart = [float(first.parameters[k]) - float(second.parameters[k]) for k in ('x', 'z')]
        if math.hypot(*apart) >= LEAST_APART * context.size:
            return first, second


MOST_MISSING = 0.7
"""Largest share of its rate that a second pump does not deliver."""


def equal_names(described: EffectDescription) -> tuple[str, ...]:
    """Return the names of the library effects that no map can tell from `described`.

    An effect of the library is among them itself.
    """
    if described.name not in EFFECTS:
        return RIG_EFFECTS[described.name].equal_to
    equal = {described.name, *effect(described.name).equal_to(described.parameters)}
    return tuple(name for name in EFFECTS if name in equal)
