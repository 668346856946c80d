"""Have the effects believable parameters, each once?"""

from collections.abc import Iterator

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.rig.description import Rig

MOST_USUAL_FACTOR = 10.0
"""Factor on a rate, a depth or a porosity [-] above which it is probably a percentage."""


def _find(rig: Rig) -> Iterator[Remark]:
    for number, effect in enumerate(rig.effects):
        key = f'effects: {effect.name}: rate'
        remark = rate_remark(key, effect.water_ml_h, rig.pore_volume)
        yield from [remark] if remark else []
        factor = effect.parameters.get('factor')
        if isinstance(factor, int | float) and factor > MOST_USUAL_FACTOR:
            yield Remark(
                f'effects: {effect.name}: factor',
                f'{factor:g}',
                f'{factor:g} times the nominal value',
                f'write {factor / 100:g} if {factor:g} % is meant',
                code='percentage',
            )
        if effect in rig.effects[:number]:
            why = 'it repeats an effect above with the same parameters, and both act'
            key = f'effects.{number + 1}'
            yield Remark(key, effect.name, why, 'keep one of them', code='repeated_effect')


CHECK = Check(find=_find)
