"""Traits of effects that fits and searches treat differently, from the registry of effects."""

from collections.abc import Iterable

from porotwin_core.rig import EffectDescription
from porotwin_solver.effects import EFFECTS


def needs_simulation(effect: str) -> bool:
    """Return whether an effect acts in the rig, so each change needs a new simulation."""
    return EFFECTS[effect].needs_simulation


def is_of_camera(effect: str) -> bool:
    """Return whether an effect belongs to the camera."""
    return effect in EFFECTS and EFFECTS[effect].is_of_camera


def has_place(effect: str) -> bool:
    """Return whether an effect has a place that a search must find."""
    return EFFECTS[effect].has_place


def is_slow_on_fine_grids(effects: Iterable[EffectDescription]) -> bool:
    """Return whether a simulation with `effects` on a large fine grid takes minutes."""
    return any(EFFECTS[effect.name].is_slow_on_fine_grids for effect in effects)


def misfit_allowance(effects: Iterable[str]) -> float:
    """Return the factor [-] on the allowed misfit of the true effects with these names."""
    return max((EFFECTS[effect].misfit_allowance for effect in effects), default=1.0)
