"""Do the effects of rig.yaml act in this experiment, and does the twin take them out of maps?"""

import math
from collections.abc import Iterator

from porotwin_checks.known import Known
from porotwin_core.basis.check import Check
from porotwin_core.basis.remark import Remark
from porotwin_core.model.effect_parameter import onset
from porotwin_solver.effects import EFFECTS, acting


def _find(known: Known) -> Iterator[Remark]:
    end = known.end or math.inf
    begun = acting(known.rig.effects, end)
    for number, described in enumerate(known.rig.effects, start=1):
        key = f'effects.{number}'
        if described not in begun:
            why = f'it begins at {onset(described):g} s, and the experiment ends at {end:g} s'
            remedy = 'was the onset in another unit? write seconds, or remove the effect'
            yield Remark(key, described.name, why, remedy, code='late_effect')
        if described.name in EFFECTS and EFFECTS[described.name].is_of_camera:
            why = (
                'simulations show this effect of the camera, but the twin does not take it out of '
                'photographs'
            )
            remedy = 'correct the camera or calibrate it again'
            yield Remark(key, described.name, why, remedy, code='camera_effect')


CHECK = Check(needs=('rig',), find=_find)
