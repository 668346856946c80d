"""The effects that the virtual rig may have: one module each, found by itself.

Most are the counterparts of the effects in `porotwin_solver.effects`, written independently. The
others have no counterpart; with them a diagnosis is tested for saying that it has no explanation.
`definition` defines the class of effects; every other module of this folder is an effect.
"""

from porotwin_rig.effects.definition.registry import (
    EFFECTS,
    EffectSet,
    parse_effects,
)

__all__ = ['EFFECTS', 'EffectSet', 'parse_effects']
