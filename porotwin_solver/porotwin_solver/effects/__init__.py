"""The effects that a rig may have and its owner does not know; one file each (diagnosis contract).

A module of this package that defines `EFFECT` is found by itself: adding a file adds an effect.
"""

from porotwin_solver.effects.registry import EFFECTS, apply_effects, effect, parse_effect

__all__ = ['EFFECTS', 'apply_effects', 'effect', 'parse_effect']
