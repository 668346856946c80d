"""Effects with random parameters: the library of the solver, and effects that it lacks."""

from collections.abc import Mapping

from numpy.random import Generator

from porotwin_core.model.blind_draw import Draw, DrawContext
from porotwin_core.rig import EffectDescription
from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_solver.effects import EFFECTS

LIBRARY: Mapping[str, Draw] = {
    name: found.blind_draw
    for name, found in EFFECTS.items()
    if found.blind_draw is not None and name in RIG_EFFECTS
}
"""Draws of the effects that the diagnosis searches and the virtual rig has, in their order."""

OUTSIDE: Mapping[str, Draw] = {
    name: found.blind_draw
    for name, found in RIG_EFFECTS.items()
    if found.blind_draw is not None and name not in EFFECTS
}
"""Draws of the effects that no library has; the right answer is `unexplained`."""


def drawn(name: str, generator: Generator, context: DrawContext) -> EffectDescription:
    """Return the effect `name` with random parameters for `context`."""
    draw = {**LIBRARY, **OUTSIDE}[name]
    return EffectDescription(name=name, parameters=draw(generator, context))
