"""The effects that the virtual rig may have, one module each.

Most effects have a counterpart in `porotwin_solver.effects`, written independently. Effects without
counterpart test whether the diagnosis admits that it has no explanation. `definition` defines the
class of effects. Every other module of this folder is an effect.
"""

from porotwin_rig.effects.definition.registry import (
    EFFECTS,
    EffectSet,
    parse_effects,
    refuse_slips,
)

__all__ = ['EFFECTS', 'EffectSet', 'parse_effects', 'refuse_slips']
