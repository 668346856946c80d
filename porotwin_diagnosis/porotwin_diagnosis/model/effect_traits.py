"""Traits of single effects that fits and searches treat differently, all in one place."""

from collections.abc import Iterable

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.candidate import IMAGE, LOCAL

SLOW_ON_FINE_GRIDS = ('dispersion',)
"""Effects whose simulation on a large fine grid takes minutes."""

TRIED_IN_EVERY_PAIR = ('saturation', 'illumination')
"""Effects that are tried beside every other one: they cost no simulation, and their response is not
linear, so that the linear gain underrates them."""

MISFIT_ALLOWANCES = {'viscosity': 1.5}
"""Factors on the misfit that a true effect may leave. The flow that a viscosity drives is solved on
coarser cells: true viscosities left a normalised misfit of 0.26 to 0.69, other effects half of
that."""


def needs_simulation(effect: str) -> bool:
    """Return whether an effect acts in the rig; effects of the camera act on simulated maps."""
    return effect not in IMAGE


def has_place(effect: str) -> bool:
    """Return whether the place of an effect must be found."""
    return effect in LOCAL


def is_slow_on_fine_grids(effects: Iterable[EffectDescription]) -> bool:
    """Return whether a simulation with `effects` on a large fine grid takes minutes."""
    return any(effect.name in SLOW_ON_FINE_GRIDS for effect in effects)


def destabilises_fronts(effects: Iterable[EffectDescription]) -> bool:
    """Return whether fronts finger with `effects`: tracer that is less viscous than water."""
    return any(float(effect.parameters.get('viscosity_ratio', 1.0)) < 1.0 for effect in effects)


def misfit_allowance(effects: Iterable[str]) -> float:
    """Return the factor [-] on the misfit that the true effects of these names may leave."""
    return max((MISFIT_ALLOWANCES.get(effect, 1.0) for effect in effects), default=1.0)
