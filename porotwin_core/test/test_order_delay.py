"""Tests of the delay of orders: how it is learnt, and the rates until an order is set."""

import pytest

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.order_delay import MOST_DELAY_S, OrdersAhead
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates
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


def history(*known: KnownRates, orders: dict[float, WellRates]) -> RateHistory:
    """Return the history of `orders` by their times [s], and of `known` rates."""
    found = RateHistory(SAFE, CONTROL_WELLS)
    for time, order in orders.items():
        found.add_commanded(time, order)
    for item in known:
        found.add_known(item)
    return found


def confirmed(time: float, told: WellRates) -> KnownRates:
    return KnownRates(time, time, told)


def late_person(delay: float, orders: int) -> RateHistory:
    """Return the knowledge from `orders` that were each set `delay` [s] later."""
    given = {1000.0 * number: rates(100.0 + 10.0 * number) for number in range(orders)}
    known = [confirmed(time + delay, order) for time, order in given.items()]
    return history(*known, orders=given)


def waits(known: RateHistory, now: float) -> bool:
    return known.ahead(now, SAFE).waits


def test_nothing_is_expected_before_the_first_order() -> None:
    assert RateHistory(SAFE).ahead(0.0, SAFE) == OrdersAhead()


@pytest.mark.parametrize(('orders', 'expected'), [(1, 90.0), (2, 180.0), (5, 180.0)])
def test_the_delay_of_a_late_person_is_learnt(orders: int, expected: float) -> None:
    assert late_person(180.0, orders).ahead(9000.0, SAFE).lead == expected


def test_a_prompt_person_has_no_delay() -> None:
    assert late_person(5.0, 3).ahead(9000.0, SAFE).lead == 0.0


def test_meters_tell_when_an_order_was_set() -> None:
    order = rates(200.0)
    measured = [KnownRates(0.0, 60.0, SAFE), KnownRates(60.0, 120.0, order)]
    ahead = history(*measured, orders={0.0: order}).ahead(120.0, order)
    assert (ahead.lead, ahead.waits) == (30.0, False)


def test_orders_are_set_in_turn() -> None:
    order = rates(200.0)
    known = history(KnownRates(60.0, 120.0, SAFE), orders={0.0: order, 60.0: SAFE})
    assert known.ahead(120.0, order).lead == 0.0
    known.add_known(KnownRates(120.0, 180.0, rates(190.0)))
    ahead = known.ahead(180.0, order)
    assert (ahead.lead, ahead.waits) == (60.0, True)


def test_a_person_may_leave_an_order_out() -> None:
    newer = rates(0.0, 300.0)
    known = history(confirmed(120.0, newer), orders={0.0: rates(200.0), 60.0: newer})
    assert not waits(known, 121.0)


def test_an_order_set_at_another_rate_is_set() -> None:
    known = history(confirmed(60.0, rates(50.0)), orders={0.0: rates(200.0)})
    assert not waits(known, 61.0)


def resting(order: WellRates) -> WellRates:
    """Return `order` while the injector rests and the producer takes out as much less."""
    less = order['producer'].rate + order['injector'].rate
    return {**order, 'injector': WellRate(), 'producer': WellRate(less)}


@pytest.mark.parametrize('metered', [False, True])
def test_a_pause_of_the_injector_sets_no_order(metered: bool) -> None:
    order, length = rates(200.0), 60.0 if metered else 0.0
    known = history(KnownRates(60.0, 60.0 + length, resting(SAFE)), orders={0.0: order})
    assert waits(known, 130.0)
    known.add_known(KnownRates(180.0, 180.0 + length, resting(order)))
    assert not waits(known, 241.0)


def test_an_order_that_changes_no_control_well_is_judged_by_the_others() -> None:
    order = resting(SAFE)
    known = history(confirmed(60.0, SAFE), orders={0.0: order})
    assert waits(known, 61.0)
    known.add_known(confirmed(90.0, order))
    assert not waits(known, 91.0)


def test_the_rates_until_an_order_is_set_are_those_ordered_before() -> None:
    known, before, order = late_person(180.0, 2), rates(110.0), rates(0.0, 300.0)
    known.add_commanded(5000.0, order)
    ahead = known.ahead(5060.0, before)
    assert ahead.waits
    assert ahead.lead == 180.0
    assert ahead.steps == (RateStep(0.0, before), RateStep(120.0, order))


def test_an_order_is_not_believed_before_it_is_told_by_a_person_who_tells() -> None:
    silent, told = history(orders={}), late_person(60.0, 1)
    for known in (silent, told):
        known.add_commanded(5000.0, rates(300.0))
    assert silent.at(5000.0) == rates(300.0)
    assert told.at(5000.0) == rates(100.0)


def test_an_order_that_is_never_set_is_forgotten() -> None:
    known = late_person(60.0, 1)
    known.add_commanded(5000.0, rates(300.0))
    assert known.at(4999.0 + MOST_DELAY_S) == rates(100.0)
    assert known.at(5001.0 + MOST_DELAY_S) == rates(300.0)
    known.add_commanded(6000.0, rates(200.0))
    assert known.at(6000.0) == rates(200.0), 'nobody tells any more'


def test_an_order_that_the_asset_did_not_take_is_not_waited_for() -> None:
    known = history(orders={0.0: rates(300.0)})
    known.take_back(0.0)
    assert not waits(known, 10.0)
    assert known.at(10.0) == SAFE


def test_pumps_that_set_themselves_are_not_waited_for() -> None:
    order = rates(300.0)
    known = history(KnownRates(2.0, 30.0, order), orders={0.0: order, 60.0: SAFE})
    assert known.at(60.0) == SAFE
