"""Tests of the history of rates: which rates were in force, when, and how sure."""

import itertools
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates import rate_history
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.order_delay import MOST_DELAY_S
from porotwin_core.rates.rate_history import Order, RateHistory, Source, TracedPeriod
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import RateStep, WellRate, WellRates
from porotwin_core.rig import load_rig

SMALL = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
REST = {'a': WellRate(), 'out': WellRate()}
FIRST = {'a': WellRate(1e-7), 'out': WellRate(-1e-7)}
SECOND = {'a': WellRate(2e-7), 'out': WellRate(-2e-7)}

Event = Order | KnownRates


def order(start: float, rates: WellRates, valid_until: float = math.inf) -> Order:
    return Order(start, rates, valid_until)


def confirmed(time: float, rates: WellRates) -> KnownRates:
    return KnownRates(time, time, rates)


def measured(start: float, end: float, rates: WellRates) -> KnownRates:
    return KnownRates(start, end, rates)


def add(history: RateHistory, event: Event) -> None:
    if isinstance(event, Order):
        history.add_commanded(*event)
    else:
        history.add_known(event)


def history_of(*events: Event, safe: WellRates = REST) -> RateHistory:
    history = RateHistory(safe, ('a',))
    for event in events:
        add(history, event)
    return history


def in_force(history: RateHistory, start: float, end: float) -> list[tuple[float, float, str]]:
    """Return the periods with the names of their rates."""
    names = {id(REST): 'rest', id(FIRST): 'first', id(SECOND): 'second'}
    return [(one.start, one.end, names[id(one.rates)]) for one in history.traced(start, end)]


# --- rates in force -----------------------------------------------------------------------------


def test_setpoints_hold_from_their_photograph_on() -> None:
    history = history_of(order(30.0, FIRST), order(60.0, SECOND))
    assert history.traced(0.0, 90.0) == (
        TracedPeriod(0.0, 30.0, REST, Source.ASSUMED),
        TracedPeriod(30.0, 60.0, FIRST, Source.COMMANDED),
        TracedPeriod(60.0, 90.0, SECOND, Source.COMMANDED),
    )
    assert (history.until(60.0), history.at(60.0)) == (FIRST, SECOND)


def test_of_two_setpoints_of_one_photograph_the_later_arrival_counts() -> None:
    history = history_of(order(60.0, SECOND), order(60.0, FIRST))
    assert history.periods(60.0, 90.0) == (RatePeriod(60.0, 90.0, FIRST),)
    assert (history.is_commanded(60.0), history.is_commanded(30.0)) == (True, False)


def test_measured_rates_count_in_their_period_and_the_setpoint_after_it() -> None:
    history = history_of(order(0.0, FIRST), measured(10.0, 20.0, SECOND))
    assert in_force(history, 0.0, 30.0) == [
        (0.0, 10.0, 'first'),
        (10.0, 20.0, 'second'),
        (20.0, 30.0, 'first'),
    ]
    assert [one.source for one in history.traced(0.0, 20.0)][1] is Source.MEASURED


def test_measured_rates_go_on_where_no_setpoint_has_come() -> None:
    history = history_of(measured(10.0, 20.0, FIRST))
    assert history.traced(10.0, 30.0) == (
        TracedPeriod(10.0, 20.0, FIRST, Source.MEASURED),
        TracedPeriod(20.0, 30.0, FIRST, Source.KEPT),
    )


def test_of_several_known_rates_the_latest_begun_count() -> None:
    history = history_of(measured(0.0, 40.0, FIRST), measured(10.0, 20.0, SECOND))
    assert in_force(history, 0.0, 40.0) == [
        (0.0, 10.0, 'first'),
        (10.0, 20.0, 'second'),
        (20.0, 40.0, 'first'),
    ]
    history.add_known(confirmed(30.0, REST))
    assert in_force(history, 25.0, 50.0) == [(25.0, 30.0, 'first'), (30.0, 50.0, 'rest')]


def test_the_first_confirmation_tells_when_the_order_before_it_was_set() -> None:
    history = history_of(order(0.0, FIRST), order(30.0, FIRST))
    assert in_force(history, 0.0, 60.0) == [(0.0, 60.0, 'first')]
    history.add_known(confirmed(45.0, FIRST))
    assert history.traced(0.0, 60.0) == (
        TracedPeriod(0.0, 45.0, REST, Source.KEPT),
        TracedPeriod(45.0, 60.0, FIRST, Source.CONFIRMED),
    )


def test_confirmed_rates_hold_until_the_next_order_is_set() -> None:
    other = {'a': WellRate(0.9e-7), 'out': WellRate(-0.9e-7)}
    history = history_of(order(0.0, FIRST), confirmed(5.0, other))
    history.add_commanded(30.0, FIRST)  # the person is told again, and has not answered
    assert history.at(50.0) == other
    history.add_known(confirmed(55.0, FIRST))
    assert history.periods(30.0, 60.0) == (
        RatePeriod(30.0, 55.0, other),
        RatePeriod(55.0, 60.0, FIRST),
    )


def test_who_never_tells_is_away_after_a_while() -> None:
    history = history_of(order(0.0, FIRST), confirmed(5.0, FIRST), order(100.0, SECOND))
    away = 100.0 + MOST_DELAY_S
    assert in_force(history, 90.0, away + 50.0) == [
        (90.0, 100.0, 'first'),
        (100.0, away, 'first'),
        (away, away + 50.0, 'second'),
    ]
    history.add_commanded(away + 60.0, REST)
    assert history.at(away + 60.0) == REST


def test_a_setpoint_that_ends_without_a_successor_leaves_the_safe_rates() -> None:
    history = history_of(order(0.0, FIRST, 90.0), confirmed(10.0, FIRST))
    assert history.traced(50.0, 120.0)[-1] == TracedPeriod(90.0, 120.0, REST, Source.SAFE)
    assert (history.order(90.0), history.order(90.1)) == (Order(0.0, FIRST, 90.0), None)
    history.add_commanded(60.0, FIRST, 150.0)
    assert in_force(history, 50.0, 120.0) == [(50.0, 120.0, 'first')]


@pytest.mark.parametrize('told', [False, True])
def test_an_announced_pause_acts_on_rates_from_before_it(told: bool) -> None:
    events: list[Event] = [order(0.0, FIRST)]
    events += [confirmed(10.0, FIRST)] if told else []
    history = history_of(*events)
    history.pauses = FixedPauses({'a': ((60.0, 120.0),)}, {'a': FIRST['a']}, 'out')
    found = history.periods(30.0, 150.0)
    assert [(one.start, one.rates['a'].rate) for one in found] == [
        (30.0, 1e-7),
        (60.0, 0.0),
        (120.0, 1e-7),
    ]
    history.add_known(confirmed(80.0, FIRST))  # somebody lets the well run
    history.add_known(measured(125.0, 130.0, REST))
    found = history.periods(70.0, 150.0)
    assert [(one.start, one.rates['a'].rate) for one in found] == [
        (70.0, 0.0),
        (80.0, 1e-7),
        (125.0, 0.0),
        (130.0, 1e-7),
    ]


def test_an_unknown_well_is_refused() -> None:
    history = RateHistory(REST, known_wells=('a', 'out'))
    with pytest.raises(InputError, match=r"well 'pump' is not in rig.yaml; known: a, out"):
        history.add_commanded(0.0, {'pump': WellRate()})
    assert history.begins is None


# --- plans -------------------------------------------------------------------------------------


def test_a_person_who_told_when_orders_were_set_is_waited_for() -> None:
    history = history_of(order(0.0, FIRST), confirmed(100.0, FIRST), order(120.0, SECOND))
    # half of the delay so far, as the hub expects it
    assert history.plan(120.0, 300.0) == (RateStep(0.0, FIRST), RateStep(50.0, SECOND))
    assert history.plan(150.0, 300.0) == (RateStep(0.0, FIRST), RateStep(20.0, SECOND))
    assert history.periods(120.0, 150.0) == (RatePeriod(120.0, 150.0, FIRST),)
    history.add_known(confirmed(160.0, SECOND))
    assert history.plan(160.0, 300.0) == (RateStep(0.0, SECOND),)
    assert in_force(history, 150.0, 180.0) == [(150.0, 160.0, 'first'), (160.0, 180.0, 'second')]


def test_nobody_is_waited_for_who_was_told_no_change() -> None:
    history = RateHistory.of(SMALL)
    told = [
        safe_rates(SMALL) | {'control1': WellRate(from_ml_h(rate))} for rate in (100, 100.6, 101.2)
    ]
    history.add_commanded(0.0, told[0])
    history.add_known(confirmed(20.0, told[0]))
    history.add_commanded(30.0, told[1])
    assert not history.ahead(40.0, told[0]).waits
    assert history.plan(40.0, 300.0) == (RateStep(0.0, told[0]),)
    history.add_commanded(60.0, told[2])  # small changes add up
    assert history.ahead(70.0, told[0]).waits


def test_confirmed_rates_are_present_until_a_newer_setpoint_of_a_prompt_person() -> None:
    history = history_of(order(0.0, FIRST), confirmed(10.0, SECOND))
    assert history.plan(20.0, 300.0) == (RateStep(0.0, SECOND),)
    history.add_commanded(30.0, FIRST)
    assert history.plan(30.0, 300.0) == (RateStep(0.0, FIRST),)


def test_rates_confirmed_at_the_very_time_of_a_setpoint_hold() -> None:
    history = history_of(order(30.0, FIRST), confirmed(30.0, SECOND))
    assert history.plan(30.0, 300.0) == (RateStep(0.0, SECOND),)
    assert history.periods(30.0, 60.0) == (RatePeriod(30.0, 60.0, SECOND),)


def test_the_setpoints_of_pumps_that_follow_at_once_are_present_at_once() -> None:
    history = history_of(order(0.0, FIRST), measured(2.0, 30.0, FIRST), order(30.0, SECOND))
    assert history.plan(30.0, 300.0) == (RateStep(0.0, SECOND),)
    history.add_known(measured(32.0, 60.0, SECOND))
    assert history.periods(30.0, 60.0) == (RatePeriod(30.0, 60.0, SECOND),)


def test_announced_pauses_are_in_the_plan() -> None:
    history = history_of(safe=FIRST)
    history.pauses = FixedPauses({'a': ((60.0, 120.0),)}, {'a': FIRST['a']}, 'out')
    assert history.plan(30.0, 300.0) == (
        RateStep(0.0, FIRST),
        RateStep(30.0, REST),
        RateStep(90.0, FIRST),
    )


# --- clocks and memory --------------------------------------------------------------------------


def test_the_rates_in_force_go_on_when_the_clock_was_set() -> None:
    history = history_of(order(500.0, FIRST), order(530.0, SECOND))
    history.begin_anew(10.0)
    assert history.begins == 10.0
    assert history.periods(10.0, 40.0) == (RatePeriod(10.0, 40.0, SECOND),)
    history.add_commanded(40.0, FIRST)
    assert in_force(history, 40.0, 600.0) == [(40.0, 600.0, 'first')]


def test_rates_that_came_just_before_the_first_photograph_by_a_new_clock_count() -> None:
    history = history_of(order(500.0, FIRST), order(8.0, SECOND))
    history.begin_anew(10.0)
    assert in_force(history, 10.0, 40.0) == [(10.0, 40.0, 'second')]


def test_what_is_forgotten_leaves_the_later_answers_as_they_are() -> None:
    events = [
        order(0.0, FIRST),
        confirmed(20.0, FIRST),
        order(60.0, SECOND),
        measured(80, 130, REST),
    ]
    kept, forgetting = history_of(*events), history_of(*events)
    forgetting.forget_before(90.0)
    for history in (kept, forgetting):
        history.add_known(confirmed(140.0, SECOND))
    assert forgetting.traced(90.0, 200.0) == kept.traced(90.0, 200.0)


def test_a_long_history_keeps_volumes_and_the_newest_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rate_history, 'MOST_EVENTS', 16)
    rates = [{'a': WellRate(1e-7 * (1 + n % 5))} for n in range(100)]
    history = history_of(*(order(30.0 * number, one) for number, one in enumerate(rates)))
    assert len(history.traced(0.0, 3000.0)) <= 32
    volume = 30.0 * sum(one['a'].rate for one in rates)
    assert injected(history, 0.0, 3000.0) == pytest.approx(volume)
    assert [one.rates for one in history.periods(2850.0, 3000.0)] == rates[-5:]


def injected(history: RateHistory, start: float, end: float) -> float:
    """Return the volume [m^3] that all wells inject from `start` to `end` [s]."""
    return sum(
        (one.end - one.start) * max(well.rate, 0.0)
        for one in history.traced(start, end)
        for well in one.rates.values()
    )


# --- properties ---------------------------------------------------------------------------------

TIMES = st.integers(0, 120).map(lambda number: 15.0 * number)
RATES = st.sampled_from([REST, FIRST, SECOND])
EVENTS = st.one_of(
    st.builds(lambda time, rates: Order(time, rates, time + 90.0), TIMES, RATES),
    st.builds(confirmed, TIMES, RATES),
    st.builds(lambda a, b, rates: KnownRates(min(a, b), max(a, b), rates), TIMES, TIMES, RATES),
)
MANY = st.lists(EVENTS, max_size=25)
HISTORIES = MANY.map(lambda events: history_of(*events))


@settings(deadline=None)
@given(HISTORIES, TIMES, TIMES)
def test_periods_tile_the_interval(history: RateHistory, start: float, length: float) -> None:
    end = start + length + 1.0
    found = history.traced(start, end)
    assert (found[0].start, found[-1].end) == (start, end)
    assert all(one.end == other.start for one, other in itertools.pairwise(found))
    assert all(one.start < one.end for one in found)


@settings(deadline=None)
@given(HISTORIES, st.lists(TIMES, min_size=3, max_size=3, unique=True))
def test_the_volume_is_additive(history: RateHistory, times: list[float]) -> None:
    begin, middle, end = sorted(times)
    parts = injected(history, begin, middle) + injected(history, middle, end)
    assert parts == pytest.approx(injected(history, begin, end), rel=1e-9, abs=1e-18)


@settings(deadline=None)
@given(MANY, EVENTS)
def test_what_was_measured_or_confirmed_changes_only_by_other_knowledge_of_that_time(
    events: list[Event], late: Event
) -> None:
    before, after = history_of(*events), history_of(*events)
    add(after, late)
    for period in before.traced(0.0, late.start):
        if period.source in (Source.MEASURED, Source.CONFIRMED):
            again = after.traced(period.start, period.end)
            assert {one.source for one in again} <= {Source.MEASURED, Source.CONFIRMED}
            assert all(one.rates == period.rates for one in again)


@settings(deadline=None)
@given(MANY, RATES, TIMES)
def test_an_equal_confirmation_of_known_rates_changes_nothing(
    events: list[Event], rates: WellRates, time: float
) -> None:
    times = [event.start if isinstance(event, Order) else event.end for event in events]
    start = max([time, *times]) + 1.0
    told = [*events, order(start, rates), confirmed(start, rates)]
    once, twice = history_of(*told), history_of(*told)
    twice.add_known(confirmed(start + 40.0, rates))
    assert once.periods(0.0, start + 900.0) == twice.periods(0.0, start + 900.0)


@settings(deadline=None)
@given(MANY, TIMES)
def test_answers_do_not_depend_on_what_was_forgotten(events: list[Event], time: float) -> None:
    kept, forgetting = history_of(*events), history_of(*events)
    forgetting.forget_before(time)
    assert forgetting.periods(time, 2000.0) == kept.periods(time, 2000.0)


@pytest.mark.parametrize(
    ('start', 'end', 'rate_ml_h', 'why'),
    [(40.0, 50.0, 5e6, 'send m'), (55.0, 40.0, 400.0, 'send start <= stamp')],
)
def test_rates_that_no_pump_can_have_are_refused_by_everybody(
    start: float, end: float, rate_ml_h: float, why: str
) -> None:
    history = RateHistory.of(SMALL)
    rates = {'control1': WellRate(from_ml_h(rate_ml_h))}
    with pytest.raises(InputError, match=why):
        history.add_known(KnownRates(start, end, rates))
    assert history.begins is None
