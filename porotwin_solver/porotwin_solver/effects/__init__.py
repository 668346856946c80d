"""The catalogue of effects: one module each, found by itself (docs/extend/effect.md).

`definition` defines the class of effects; every other module of this folder is an effect.
"""

from porotwin_solver.effects.definition.registry import (
    EFFECTS,
    acting,
    changed_physics,
    described_changes,
    described_physics,
    effect,
    effects_of,
    observation_operator,
    parse_effect,
    parse_effects,
    physics_on_top,
    rig_at,
    tracer_storage,
)

__all__ = [
    'EFFECTS',
    'acting',
    'changed_physics',
    'described_changes',
    'described_physics',
    'effect',
    'effects_of',
    'observation_operator',
    'parse_effect',
    'parse_effects',
    'physics_on_top',
    'rig_at',
    'tracer_storage',
]
