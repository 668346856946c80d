"""The tracer stock that a plan leaves in its bottle."""

import math
from pathlib import Path

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.bottle import bottle_at
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig, load_rig

SMALL = load_rig(Path(__file__).resolve().parents[2] / 'rigs' / 'small' / 'rig.yaml')
FULL, REST = WellRate(from_ml_h(600.0), 1.0), WellRate()
PLAN = Schedule(
    (
        ScheduleRow(0.0, 'injector', FULL),
        ScheduleRow(600.0, 'injector', REST),
        ScheduleRow(1200.0, 'injector', WellRate(from_ml_h(600.0), 0.5)),
        ScheduleRow(1200.0, 'producer', WellRate(-from_ml_h(600.0), 0.0)),
    )
)
"""100 ml until 600 s, a rest, and 300 ml/h of stock from 1200 s on."""


def with_stock(stock_ml: float | None) -> Rig:
    assert SMALL.control is not None
    return SMALL.model_copy(
        update={'control': SMALL.control.model_copy(update={'stock_ml': stock_ml})}
    )


@pytest.mark.parametrize(
    ('time', 'left_ml'),
    [(-5.0, 150.0), (300.0, 100.0), (900.0, 50.0), (1500.0, 25.0), (1900.0, 0.0)],
)
def test_the_bottle_loses_the_stock_that_the_plan_injects(time: float, left_ml: float) -> None:
    bottle = bottle_at(with_stock(150.0), PLAN, time)
    assert bottle is not None
    assert bottle.left == pytest.approx(left_ml * 1e-6, abs=1e-12)
    assert bottle.empty_at == pytest.approx(1800.0)


def test_round_off_is_no_rest_in_the_bottle() -> None:
    rate = from_ml_h(600.0)
    times = [60.0 * number / 7 for number in range(20)]
    rows = tuple(ScheduleRow(time, 'injector', WellRate(rate, 1.0)) for time in times)
    for end in (1234.5, 900.1, 777.7, 10.1):
        bottle = bottle_at(with_stock(rate * end * 1e6 * (1.0 + 1e-14)), Schedule(rows), end)
        assert bottle is not None
        assert bottle.left == 0.0


def test_a_plan_that_ends_leaves_the_rest_for_ever() -> None:
    ended = Schedule(PLAN.rows[:2])
    bottle = bottle_at(with_stock(150.0), ended, 1e5)
    assert bottle is not None
    assert bottle.left == pytest.approx(50e-6)
    assert math.isinf(bottle.empty_at)
    assert bottle_at(SMALL, PLAN, 0.0) is None
