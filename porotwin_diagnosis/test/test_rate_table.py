"""Tests of the table of rates: rows that are kept, and rows that are averaged."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_diagnosis.data.rate_table import RateTable

WELLS = ('injector', 'producer')


def injecting(rate: float) -> dict[str, WellRate]:
    return {'injector': WellRate(rate, 0.5)}


def test_rows_come_back_in_their_order():
    table = RateTable(WELLS)
    table.add(30.0, injecting(1e-7), commanded=True)
    table.add(0.0, {}, commanded=False)
    assert list(table.rows(1e9)) == [(30.0, injecting(1e-7)), (0.0, {})]


def test_measured_rates_replace_setpoints_of_their_interval():
    table = RateTable(WELLS)
    for start, commanded in ((0.0, True), (30.0, True), (45.0, False), (90.0, True)):
        table.add(start, injecting(1e-7), commanded=commanded)
    table.add_measured(30.0, 60.0, injecting(2e-7))
    assert [start for start, _ in table.rows(1e9)] == [0.0, 45.0, 90.0, 30.0]
    with pytest.raises(InputError, match="well 'bogus'"):
        table.add_measured(0.0, 100.0, {'bogus': WellRate()})
    assert len(table) == 4, 'no commanded rate is lost'


def test_a_setpoint_at_the_end_of_a_measurement_holds_from_then_on():
    table = RateTable(WELLS)
    for start, rate in ((0.0, 1e-7), (30.0, 2e-7)):
        table.add_commanded(start, injecting(rate))
    table.add_measured(0.0, 30.0, injecting(0.9e-7))
    rows = Schedule.from_rates(table.rows(60.0)).rows
    assert [(row.time, row.rate.rate) for row in rows] == [(0.0, 0.9e-7), (30.0, 2e-7)]


def test_the_last_rates_stay_in_force_in_a_new_run():
    table = RateTable(WELLS)
    table.begin_anew(5.0)
    assert len(table) == 0
    table.add(30.0, injecting(1e-7), commanded=True)
    table.add(60.0, injecting(2e-7), commanded=True)
    table.begin_anew(10.0)
    assert list(table.rows(1e9)) == [(10.0, injecting(2e-7))]


def test_a_full_table_keeps_volumes_and_the_newest_rates():
    table, rates = RateTable(WELLS, 16), [1e-7 * (n % 5) for n in range(100)]
    for number, rate in enumerate(rates):
        table.add(30.0 * number, injecting(rate), commanded=True)
    assert len(table) <= 16
    schedule = Schedule.from_rates(table.rows(1e9))
    volume = sum(
        (high - low) * found['injector'].rate
        for low, high, found in schedule.intervals(0.0, 3000.0)
    )
    assert volume == pytest.approx(30.0 * sum(rates))
    assert [found['injector'].rate for _, found in list(table.rows(1e9))[-5:]] == rates[-5:]


def test_an_unknown_well_is_refused():
    with pytest.raises(InputError, match=r"well 'pump' is not in rig.yaml; known: injector, prod"):
        RateTable(WELLS).add(0.0, {'pump': WellRate()}, commanded=True)


def test_orders_count_from_the_time_that_a_person_tells_once_one_was_told() -> None:
    table = RateTable(['injector'])
    orders = [injecting(1e-7 * number) for number in range(1, 5)]
    table.add(0.0, orders[0], commanded=True)
    assert list(table.rows(0.0)) == [(0.0, orders[0])]  # nobody has told anything yet
    table.add_measured(40.0, 40.0, orders[0])
    table.add(100.0, orders[1], commanded=True)
    assert [start for start, _ in table.rows(150.0)] == [0.0, 40.0]
    table.add_measured(220.0, 220.0, orders[1])
    assert list(table.rows(230.0))[2:] == [(220.0, orders[1])]
    table.add(300.0, orders[2], commanded=True)  # and the person is away
    assert [start for start, _ in table.rows(899.0)] == [0.0, 40.0, 220.0]
    assert list(table.rows(901.0))[3:] == [(300.0, orders[2])]
