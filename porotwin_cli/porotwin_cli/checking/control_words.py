"""The control section of a rig in words, as the program understands it."""

from collections import Counter

from porotwin_core.rig import Rig
from porotwin_core.rig.control_zones import control_zones


def control_words(rig: Rig) -> list[str]:
    """Return the limits in one line and the objective in another; nothing without control."""
    control = rig.control
    if control is None:
        return []
    most, least = control.max_change_ml_h, control.min_rate_ml_h
    limits = [
        f'{", ".join(control.wells)} up to {control.max_rate_ml_h:g} ml/h each',
        f'{control.most_total_ml_h:g} ml/h together',
        f'{control.producer} takes out up to {control.most_taken_ml_h:g} ml/h'
        if control.producer is not None
        else '',
        f'in steps of {control.rate_step_ml_h:g} ml/h',
        f'at least {least:g} ml/h where a well pumps' if least else '',
        f'{"any change" if most is None else f"at most {most:g} ml/h of change"} '
        'from setpoint to setpoint',
        'no end' if control.end_min is None else f'end after {control.end_min:g} min',
    ]
    objective = control.objective
    name = objective.name
    parts = objective.parameters.get('parts')
    if name == 'sum' and isinstance(parts, list):
        name = ' + '.join(_part(part) for part in parts)
    counted = Counter(zone.kind for zone in control_zones(rig))
    zones = ', '.join(f'{count} {kind}' for kind, count in counted.items()) or 'none'
    return [
        f'control: {", ".join(part for part in limits if part)}',
        f'objective: {name}; zones: {zones}; a new order must save '
        f'{control.change_cost_ml_min:g} ml min of it',
    ]


def _part(part: object) -> str:
    if not isinstance(part, dict):
        return '?'
    weight = part.get('weight', 1.0)
    return f'{part.get("name")}' + ('' if weight == 1.0 else f' (weight {weight})')
