"""Tracer in the zone of an objective."""

import numpy as np
import pytest
from siblings_examples import GRID, RIG

from porotwin_core.rig import ObjectiveDescription, Rig
from porotwin_siblings.zone_measure import ZoneMeasure

LEFT = [[0.0, 0.0], [RIG.width_m / 2, 0.0], [RIG.width_m / 2, RIG.height_m], [0.0, RIG.height_m]]


def with_parts(*parts: dict[str, object]) -> Rig:
    control = RIG.control.model_copy(
        update={
            'objective': ObjectiveDescription(name='sum', parameters={'parts': list(parts)}),
            'disallowed_zone_m': [],
        }
    )
    return RIG.model_copy(update={'control': control})


def test_a_sum_measures_outside_of_the_zone_that_a_part_keeps_in() -> None:
    rig = with_parts({'name': 'keep_in', 'zone_m': LEFT}, {'name': 'least_water'})
    zone = ZoneMeasure.of(rig, GRID)
    full = np.ones(GRID.shape)
    pores = rig.cell_pore_volume(GRID).sum()
    assert zone.tracer(full) == pytest.approx(0.5 * pores, rel=1e-6)
    assert zone.plume_area(full) == pytest.approx(0.5 * GRID.width * GRID.height)


def test_without_a_zone_nothing_is_measured() -> None:
    zone = ZoneMeasure.of(with_parts({'name': 'least_water'}), GRID)
    assert not zone.known
    full = np.ones(GRID.shape)
    assert np.isnan([zone.tracer(full), zone.plume_area(full), zone.reached_tracer]).all()
