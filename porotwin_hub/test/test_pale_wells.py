"""A well whose maps are paler than what it injects."""

from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.rates_in_force import RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig
from porotwin_hub.estimation.pale_wells import MAPS_IN_A_ROW, PaleWells

RIG = load_rig(Path(__file__).parents[1] / 'config' / 'small_rig.yaml')
SHAPE = (56, 93)
INJECTS = {'injector': WellRate(from_ml_h(500.0), 1.0)}


def told(wells: PaleWells, level: float, minutes: list[float]) -> list[Remark | None]:
    """Return the remark about every map of one `level`, a minute after the one before."""
    return [
        wells.remark(
            np.full(SHAPE, level),
            60.0 * minute,
            [RatePeriod(60.0 * (minute - 1.0), 60.0 * minute, INJECTS)],
        )
        for minute in minutes
    ]


def test_a_well_that_stays_pale_is_told_after_some_maps() -> None:
    found = told(PaleWells(RIG), 0.1, [*range(1, 21)])
    first = next(number for number, line in enumerate(found) if line)
    assert first >= MAPS_IN_A_ROW
    assert (found[first].code, found[first].facts['well']) == ('pale_well', 'injector')
    assert found[first].facts['share'] == pytest.approx(0.1)
    assert all(found[first:])


@pytest.mark.parametrize('level', [0.8, np.nan])
def test_a_well_full_of_tracer_or_unseen_is_not_told(level: float) -> None:
    assert not any(told(PaleWells(RIG), level, [*range(1, 21)]))


def test_an_interruption_forgets_what_was_injected() -> None:
    wells = PaleWells(RIG)
    told(wells, 0.1, [*range(1, 21)])
    wells.forget()
    assert not any(told(wells, 0.1, [21, 22]))
