"""Tests of the objective `sweep`: a region without its tracer costs."""

from typing import Any

import numpy as np
import pytest
from hub_examples import made

from porotwin_core.geometry.grid import FloatArray


@pytest.mark.parametrize('wanted', [0.0, 1.0])
def test_a_region_at_its_concentration_costs_nothing(
    unit_rig: dict[str, Any], square: FloatArray, wanted: float
) -> None:
    zones = [square.tolist()]
    _, objective = made(unit_rig, name='sweep', zones_m=zones, concentration=wanted, fuzziness_m=0)
    assert objective(np.full((50, 50), wanted)) == 0.0
    missing = objective(np.full((50, 50), 1.0 - wanted))
    assert missing == pytest.approx(0.16 * 0.01 * 0.4)
    assert objective.disallowed_tracer(np.full((50, 50), 1.0 - wanted)) == pytest.approx(missing)
    (term,) = objective.terms(0.0, 600.0)
    assert (term.start, term.end) == (0.0, 600.0)
    assert term.value(np.full((50, 50), 1.0 - wanted)) == pytest.approx(missing)


def test_beside_a_zone_to_keep_free_missing_tracer_is_not_counted_as_tracer_there(
    unit_rig: dict[str, Any], square: FloatArray
) -> None:
    zones = [square.tolist()]
    parts = [
        {'name': 'sweep', 'zones_m': zones, 'fuzziness_m': 0},
        {'name': 'keep_out', 'zones_m': zones, 'fuzziness_m': 0},
    ]
    _, objective = made(unit_rig, name='sum', parts=parts)
    assert objective.disallowed_tracer(np.zeros((50, 50))) == 0.0
    assert objective.disallowed_tracer(np.ones((50, 50))) == pytest.approx(0.16 * 0.01 * 0.4)
