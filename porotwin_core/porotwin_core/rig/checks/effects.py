"""Have the effects believable parameters, each once?"""

from collections.abc import Iterator

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

MOST_USUAL_FACTOR = 10.0
"""Factor on a rate, a depth or a porosity [-] above which it is probably a percentage."""


def _leaks(rig: Rig) -> Iterator[Remark]:
    for effect in rig.effects:
        rate = effect.parameters.get('rate')
        if effect.name == 'leak' and isinstance(rate, int | float):
            remark = rate_remark('effects: leak: rate', rate, rig.pore_volume)
            if remark is not None:
                yield remark


def _factors(rig: Rig) -> Iterator[Remark]:
    """Remark factors of pumps, depths and porosities that are probably percentages."""
    for effect in rig.effects:
        factor = effect.parameters.get('factor')
        if isinstance(factor, int | float) and factor > MOST_USUAL_FACTOR:
            yield Remark(
                f'effects: {effect.name}: factor',
                f'{factor:g}',
                f'{factor:g} times the nominal value',
                f'write {factor / 100:g} if {factor:g} % is meant',
            )


def _repeated_effects(rig: Rig) -> Iterator[Remark]:
    for number, effect in enumerate(rig.effects):
        if effect in rig.effects[:number]:
            why = 'it repeats an effect above with the same parameters, and both act'
            yield Remark(f'effects.{number + 1}', effect.name, why, 'keep one of them')


def _effects(rig: Rig) -> Iterator[Remark]:
    yield from _leaks(rig)
    yield from _factors(rig)
    yield from _repeated_effects(rig)


CHECK = Check(find=_effects)
