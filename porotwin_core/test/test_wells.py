"""Well rates and schedules."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML_H, from_ml_h, to_ml_h
from porotwin_core.rates.wells import (
    RateStep,
    Schedule,
    ScheduleRow,
    WellRate,
    check_plan,
    mean_rates,
    net_rate,
    plan_intervals,
)

SCHEDULE = Schedule(
    (
        ScheduleRow(60.0, 'b', WellRate(-2.0)),
        ScheduleRow(0.0, 'a', WellRate(2.0, 1.0)),
        ScheduleRow(90.0, 'a', WellRate(1.0, 0.0)),
    )
)


def test_a_rate_holds_until_the_next_row_of_its_well() -> None:
    assert SCHEDULE.at(59.9) == {'a': WellRate(2.0, 1.0)}
    assert SCHEDULE.at(60.0) == {'a': WellRate(2.0, 1.0), 'b': WellRate(-2.0)}
    assert SCHEDULE.at(1e9)['a'] == WellRate(1.0, 0.0)
    assert SCHEDULE.at(-1.0) == {}


def test_the_busiest_moment_has_the_largest_sum_of_rates() -> None:
    assert SCHEDULE.busiest == {'a': WellRate(2.0, 1.0), 'b': WellRate(-2.0)}
    assert Schedule().busiest == {}


def test_intervals_split_where_rates_change() -> None:
    spans = [(start, end, net_rate(rates)) for start, end, rates in SCHEDULE.intervals(30.0, 100.0)]
    assert spans == [(30.0, 60.0, 2.0), (60.0, 90.0, 0.0), (90.0, 100.0, -1.0)]


@given(start=st.floats(0, 200), length=st.floats(0, 200))
def test_intervals_cover_the_time_without_gap(start: float, length: float) -> None:
    spans = list(SCHEDULE.intervals(start, start + length))
    edges = [span[0] for span in spans] + [span[1] for span in spans[-1:]]
    assert edges == sorted(edges)
    assert not spans or (edges[0], edges[-1]) == (start, start + length)
    assert all(before[1] == after[0] for before, after in itertools.pairwise(spans))


def test_a_schedule_of_commanded_rates_has_rows_only_where_a_rate_changes() -> None:
    commanded = [(0.0, {'a': WellRate(1.0)}), (30.0, {'a': WellRate(1.0)}), (60.0, {})]
    rows = Schedule.from_rates(commanded).rows
    assert rows == (ScheduleRow(0.0, 'a', WellRate(1.0)), ScheduleRow(60.0, 'a', WellRate()))


def test_mean_rates_pump_as_much_water_and_tracer_as_the_periods() -> None:
    periods = [
        (0.0, 10.0, {'a': WellRate(3.0, 1.0), 'b': WellRate(-3.0)}),
        (10.0, 40.0, {'a': WellRate(1.0, 0.0)}),
    ]
    mean = mean_rates(periods)
    assert mean['a'].rate * 40.0 == pytest.approx(3.0 * 10.0 + 1.0 * 30.0)
    assert mean['a'].rate * mean['a'].concentration * 40.0 == pytest.approx(3.0 * 10.0)
    assert mean['b'].rate * 40.0 == pytest.approx(-3.0 * 10.0)


def test_the_production_of_a_well_does_not_dilute_the_tracer_that_it_injected() -> None:
    periods = [(0.0, 1.0, {'a': WellRate(2.0, 0.5)}), (1.0, 2.0, {'a': WellRate(-1.0)})]
    assert mean_rates(periods) == {'a': WellRate(0.5, 0.5)}


@pytest.mark.parametrize(
    ('rate', 'concentration'), [(float('nan'), 0.0), (float('inf'), 0.0), (1.0, 1.5), (1.0, -0.1)]
)
def test_impossible_rates_are_refused(rate: float, concentration: float) -> None:
    with pytest.raises(InputError):
        WellRate(rate, concentration)


def test_500_ml_h_fill_half_a_litre_in_an_hour() -> None:
    assert from_ml_h(500.0) * 3600.0 == pytest.approx(500e-6)
    assert to_ml_h(ML_H) == pytest.approx(1.0)


def test_intervals_of_a_plan_end_at_its_steps_and_at_the_edges() -> None:
    plan = (RateStep(0.0, {}), RateStep(100.0, {}), RateStep(900.0, {}))
    found = list(plan_intervals(plan, (50.0, 400.0), 300.0))
    assert found == [(0.0, 50.0, 0), (50.0, 100.0, 0), (100.0, 300.0, 1)]


@pytest.mark.parametrize('starts', [(), (1.0,), (0.0, 0.0), (0.0, math.nan), (0.0, math.inf)])
def test_a_plan_whose_times_do_not_increase_from_zero_is_refused(starts: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match='schedule: '):
        check_plan([RateStep(start, {}) for start in starts])


def test_injected_stock_is_no_water_and_no_produced_tracer() -> None:
    schedule = Schedule(
        (
            ScheduleRow(0.0, 'a', WellRate(1e-6, 0.5)),
            ScheduleRow(0.0, 'b', WellRate(-1e-6, 1.0)),
            ScheduleRow(100.0, 'a', WellRate(2e-6, 1.0)),
            ScheduleRow(150.0, 'a', WellRate(5e-6, 0.0)),
        )
    )
    assert schedule.injected_stock(0.0, 200.0) == pytest.approx(50e-6 + 100e-6)
    assert schedule.injected_stock(-math.inf, 200.0) == schedule.injected_stock(0.0, 200.0)
