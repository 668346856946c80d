"""Tests of the delay of orders: how it is learnt, and the rates until an order is set."""

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.order_delay import MOST_DELAY_S, OrderDelay
from porotwin_core.rates.rates_in_force import KnownRates
from porotwin_core.rates.wells import RateStep, WellRate, WellRates

CONTROL_WELLS = ('control1', 'control2')


def rates(control1_ml_h: float, control2_ml_h: float = 0.0) -> WellRates:
    return {
        'injector': WellRate(from_ml_h(500.0), 1.0),
        'control1': WellRate(from_ml_h(control1_ml_h)),
        'control2': WellRate(from_ml_h(control2_ml_h)),
        'producer': WellRate(-from_ml_h(500.0 + control1_ml_h + control2_ml_h)),
    }


SAFE = rates(0.0)


def confirmed(time: float, told: WellRates) -> list[KnownRates]:
    return [KnownRates(time, time, told)]


def late_person(delay: float, orders: int) -> OrderDelay:
    """Return the knowledge from `orders` that were each set `delay` [s] later."""
    learnt, before = OrderDelay(), SAFE
    for number in range(orders):
        order, time = rates(100.0 + 10.0 * number), 1000.0 * number
        learnt.ordered(time, order, before)
        learnt.learn(confirmed(time + delay, order), time + delay)
        before = order
    return learnt


def test_nothing_is_expected_before_the_first_order() -> None:
    delay = OrderDelay()
    assert delay.expected == 0.0
    assert delay.ahead(0.0, SAFE).steps == ()


@pytest.mark.parametrize(('orders', 'expected'), [(1, 90.0), (2, 180.0), (5, 180.0)])
def test_the_delay_of_a_late_person_is_learnt(orders: int, expected: float) -> None:
    assert late_person(180.0, orders).expected == expected


def test_a_prompt_person_has_no_delay() -> None:
    assert late_person(5.0, 3).expected == 0.0


def test_meters_tell_when_an_order_was_set() -> None:
    delay, order = OrderDelay(), rates(200.0)
    delay.ordered(0.0, order, SAFE)
    delay.learn([KnownRates(0.0, 60.0, SAFE), KnownRates(60.0, 120.0, order)], 120.0)
    assert delay.expected == 30.0
    assert not delay.ahead(120.0, order).waits


def test_orders_are_set_in_turn() -> None:
    delay, order = OrderDelay(), rates(200.0)
    delay.ordered(0.0, order, SAFE)
    delay.ordered(60.0, SAFE, order)
    delay.learn([KnownRates(60.0, 120.0, SAFE)], 120.0)
    assert delay.expected == 0.0
    delay.learn([KnownRates(120.0, 180.0, rates(190.0))], 180.0)
    assert delay.expected == 60.0
    assert delay.ahead(180.0, order).waits


def test_a_person_may_leave_an_order_out() -> None:
    delay, newer = OrderDelay(), rates(0.0, 300.0)
    delay.ordered(0.0, rates(200.0), SAFE)
    delay.ordered(60.0, newer, rates(200.0))
    delay.learn(confirmed(120.0, newer), 120.0)
    assert not delay.ahead(120.0, newer).waits


def test_an_order_set_at_another_rate_is_set() -> None:
    delay = OrderDelay()
    delay.ordered(0.0, rates(200.0), SAFE)
    delay.learn(confirmed(60.0, rates(50.0)), 60.0)
    assert not delay.ahead(60.0, rates(50.0)).waits


def resting(order: WellRates) -> WellRates:
    """Return `order` while the injector rests and the producer takes out as much less."""
    less = order['producer'].rate + order['injector'].rate
    return {**order, 'injector': WellRate(), 'producer': WellRate(less)}


@pytest.mark.parametrize('metered', [False, True])
def test_a_pause_of_the_injector_sets_no_order(metered: bool) -> None:
    delay, order = OrderDelay(), rates(200.0)
    delay.ordered(0.0, order, SAFE, CONTROL_WELLS)
    end = 120.0 if metered else 60.0
    delay.learn([KnownRates(60.0, end, resting(SAFE))], end)
    assert delay.ahead(end, SAFE).waits
    delay.learn([KnownRates(180.0, 180.0 + end - 60.0, resting(order))], 240.0)
    assert not delay.ahead(240.0, order).waits


def test_an_order_that_changes_no_control_well_is_judged_by_the_others() -> None:
    delay, order = OrderDelay(), resting(SAFE)
    delay.ordered(0.0, order, SAFE, CONTROL_WELLS)
    delay.learn(confirmed(60.0, SAFE), 60.0)
    assert delay.ahead(60.0, SAFE).waits
    delay.learn(confirmed(90.0, order), 90.0)
    assert not delay.ahead(90.0, order).waits


def test_the_rates_until_an_order_is_set_are_those_ordered_before() -> None:
    delay, before, order = late_person(180.0, 2), rates(110.0), rates(0.0, 300.0)
    delay.ordered(5000.0, order, before)
    ahead = delay.ahead(5060.0, before)
    assert ahead.waits
    assert ahead.lead == 180.0
    assert ahead.steps == (RateStep(0.0, before), RateStep(120.0, order))


def test_an_order_is_not_believed_before_it_is_told_by_a_person_who_tells() -> None:
    silent, told = OrderDelay(), late_person(60.0, 1)
    for delay in (silent, told):
        delay.ordered(5000.0, rates(300.0), SAFE)
    assert silent.believed(rates(300.0), SAFE) == rates(300.0)
    assert told.believed(rates(300.0), SAFE) == SAFE


def test_an_order_that_is_never_set_is_forgotten() -> None:
    delay = late_person(60.0, 1)
    delay.ordered(5000.0, rates(300.0), SAFE)
    delay.learn([], 5001.0 + MOST_DELAY_S)
    assert delay.believed(rates(300.0), SAFE) == rates(300.0)


def test_an_order_that_the_asset_did_not_take_is_not_waited_for() -> None:
    delay = OrderDelay()
    delay.ordered(0.0, rates(300.0), SAFE)
    delay.take_back(0.0)
    assert not delay.ahead(0.0, SAFE).waits


def test_pumps_that_set_themselves_are_not_waited_for() -> None:
    delay, order = OrderDelay(), rates(300.0)
    delay.ordered(0.0, order, SAFE)
    delay.learn([KnownRates(2.0, 30.0, order)], 30.0)
    delay.ordered(60.0, SAFE, order)
    assert delay.believed(SAFE, order) == SAFE
