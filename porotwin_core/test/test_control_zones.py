"""The zones that objectives name."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.rig import ObjectiveDescription, Rig, load_rig
from porotwin_core.rig.control_zones import control_zones, unwanted_tracer

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
SQUARE = [[0.2, 0.2], [0.4, 0.2], [0.4, 0.4], [0.2, 0.4]]
POINTS = np.array([[0.3, 0.3], [0.6, 0.3]])
"""Inside the square, and outside."""


def with_objective(rig: Rig, name: str, **parameters) -> Rig:
    objective = ObjectiveDescription(name=name, parameters=parameters)
    update = {'objective': objective, 'disallowed_zone_m': []}
    return rig.model_copy(update={'control': rig.control.model_copy(update=update)})


@pytest.mark.parametrize(
    ('name', 'parameters', 'kind', 'unwanted'),
    [
        ('keep_out', {'disallowed_zone_m': SQUARE}, 'keep out', [True, False]),
        ('keep_out', {'zones_m': [SQUARE]}, 'keep out', [True, False]),
        ('keep_in', {'zone_m': SQUARE}, 'keep in', [False, True]),
        ('sweep', {'zones_m': [SQUARE]}, 'target', None),
        ('reach', {'zone_m': SQUARE, 'at_min': 20}, 'target', None),
        ('hold_front', {'tracer_m': SQUARE}, 'target', None),
    ],
)
@pytest.mark.parametrize('in_a_sum', [False, True])
def test_every_objective_has_its_zone(name, parameters, kind, unwanted, in_a_sum) -> None:
    rig = with_objective(RIG, name, **parameters)
    if in_a_sum:
        parts = [{'name': name, **parameters}, {'name': 'least_water'}]
        rig = with_objective(RIG, 'sum', parts=parts)
    (zone,) = control_zones(rig)
    assert zone.kind == kind
    np.testing.assert_array_equal(zone.zone.outlines[0][:-1], SQUARE)
    found = unwanted_tracer(rig, POINTS)
    assert (None if found is None else found.tolist()) == unwanted
