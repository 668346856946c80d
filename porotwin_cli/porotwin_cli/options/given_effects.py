"""The option --effect: effects beside those of rig.yaml, such as leak:x=0.2,z=0.3,rate=9."""

import logging
from collections.abc import Iterable

from porotwin_core.basis.check import asked
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.rig.oddities import CHECKS
from porotwin_solver.effects import parse_effects

LOG = logging.getLogger('porotwin')
"""Receives a warning for everything odd."""

ON_TOP = (
    '--effect: rig.yaml has the effect {name} for the same well or place already, and both act; '
    'leave it away if one is meant'
)


def given_effects(texts: Iterable[str], rig: Rig) -> list[EffectDescription]:
    """Return effects, each written as `NAME:PARAM=VALUE,PARAM=VALUE`; odd ones are logged.

    Raises:
        InputError: an unknown effect or parameter, one that is given twice, or a value that the
            rig.yaml of `rig` may not hold either.
    """
    effects = parse_effects(texts)
    given = rig.model_copy(update={'effects': tuple(effects)})
    for remark in asked({'effects': CHECKS['effects']}, given):
        if remark.refused:
            raise InputError(str(remark))
        LOG.warning('--effect: %s', remark)
    known = set(map(_acts_on, rig.effects))
    for one in effects:
        if _acts_on(one) in known:
            LOG.warning('%s', ON_TOP.format(name=one.name))
    return effects


def _acts_on(effect: EffectDescription) -> tuple[object, ...]:
    """Return the name of an effect, its well and its place."""
    return effect.name, *(effect.parameters.get(one) for one in ('well', 'x', 'z'))
