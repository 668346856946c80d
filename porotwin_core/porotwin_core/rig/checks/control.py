"""Can the control section be meant?"""

from collections.abc import Iterator, Mapping
from typing import Any

from porotwin_core.basis.check import Check
from porotwin_core.basis.plausibility import rate_remark
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.rig.description import Rig
from porotwin_core.rig.outlines import outline_remarks

LONG_HORIZON_MIN = 60.0
"""Plans look ahead for less than this [min]."""


def _control(rig: Rig) -> Iterator[Remark]:
    control = rig.control
    if control is None:
        return
    pores = rig.pore_volume
    limits = {
        'control.max_rate_ml_h': control.max_rate_ml_h,
        'control.max_total_rate_ml_h': control.max_total_rate_ml_h,
    }
    fixed = {
        f'control.fixed.{name}.rate_ml_h': well.rate_ml_h for name, well in control.fixed.items()
    }
    for key, rate in {**limits, **fixed}.items():
        remark = rate_remark(key, rate, pores)
        if remark is not None:
            yield remark
    injected = control.most_fixed_ml_h
    if injected > control.max_total_rate_ml_h:
        yield Remark(
            'control.max_total_rate_ml_h',
            f'{control.max_total_rate_ml_h:g} ml/h',
            f'the fixed wells inject {injected:g} ml/h, more than the control wells may',
            'raise it if the tracer cannot be held',
        )
    if control.max_rate_ml_h > control.max_total_rate_ml_h:
        yield Remark(
            'control.max_rate_ml_h',
            f'{control.max_rate_ml_h:g} ml/h',
            f'no well can reach it below the sum of {control.max_total_rate_ml_h:g} ml/h',
            'exchange the two limits or correct one',
        )
    if control.fuzziness_m > max(rig.width_m, rig.height_m):
        size = f'the rig is {max(rig.width_m, rig.height_m):g} m long'
        shown = f'{control.fuzziness_m:g} m'
        yield Remark('control.fuzziness_m', shown, size, 'the whole rig then counts as the zone')
    most_dose = ML * pores * LONG_HORIZON_MIN
    if (cost := control.change_cost_ml_min or 0.0) > most_dose:
        why = f'no order can gain more than {most_dose:.2g} ml min, all of the rig for an hour'
        yield Remark('control.change_cost_ml_min', f'{cost:g}', why, 'the twin would never order')
    if not control.wells:
        yield Remark('control.wells', '[]', 'the twin may set no well', 'name the control wells')
    zones = [('control.disallowed_zone_m', control.disallowed_zone_m)]
    zones += _zones('control.objective', control.objective.parameters)
    for key, zone in zones:
        if zone:
            yield from outline_remarks(rig, key, zone)


def _zones(section: str, parameters: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the key and the corners of every zone of an objective and of its parts."""
    for key, value in parameters.items():
        where = f'{section}.{key}'
        if key.endswith('zone_m') or key == 'tracer_m':
            yield where, value
        elif key in ('zones_m', 'parts') and isinstance(value, list | tuple):
            for number, one in enumerate(value):
                if key == 'zones_m':
                    yield f'{where}.{number}', one
                elif isinstance(one, dict):
                    yield from _zones(f'{where}.{number}', one)


CHECK = Check(find=_control)
