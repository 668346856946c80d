"""Findings for the tests of the mended twin."""

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.mending.finding import Finding


def weak_pump(factor=0.7, well='injector'):
    return EffectDescription(name='rate', parameters={'well': well, 'factor': factor, 'since': 0.0})


LATE = EffectDescription(name='clock', parameters={'offset': 40.0})


def finding(*effects, camera=(), confidence=0.97, before=0.3, after=0.03, **others):
    effects = effects or (weak_pump(),)
    return Finding(
        verdict=effects[0].name if effects else camera[0].name,
        confidence=confidence,
        effects=effects,
        camera=tuple(camera),
        error_before=before,
        error_after=after,
        closed=(before - after) / (before - 0.02),
        **others,
    )


def notice():
    """Return a finding of the camera alone."""
    return Finding('clock', 0.95, (), (LATE,), 0.3, 0.03, 0.9)
