"""The catalogue of effects: one module each, found by itself (docs/extend/effect.md).

`definition` defines the class of effects; every other module of this folder is an effect.
"""

from porotwin_solver.effects.definition.registry import (
    EFFECTS,
    apply_effects,
    effect,
    effects_of,
    parse_effect,
    parse_effects,
)

__all__ = ['EFFECTS', 'apply_effects', 'effect', 'effects_of', 'parse_effect', 'parse_effects']
