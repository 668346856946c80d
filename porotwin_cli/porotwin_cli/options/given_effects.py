"""The option --effect: effects beside those of rig.yaml, such as leak:x=0.2,z=0.3,rate=9."""

from collections.abc import Iterable

from porotwin_core.basis.check import asked
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.rig.oddities import CHECKS
from porotwin_solver.effects import parse_effects


def given_effects(texts: Iterable[str], rig: Rig) -> list[EffectDescription]:
    """Return effects, each written as `NAME:PARAM=VALUE,PARAM=VALUE`.

    Raises:
        InputError: an unknown effect or parameter, one that is given twice, or a value that the
            rig.yaml of `rig` may not hold either.
    """
    effects = parse_effects(texts)
    for remark in asked({'effects': CHECKS['effects']}, rig.with_effects(effects)):
        if remark.refused:
            raise InputError(str(remark))
    return effects
