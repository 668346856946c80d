"""The person at the pumps of a scenario."""

import numpy as np
import pytest

from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.loop_operator import (
    REFUSAL_PHOTOGRAPHS,
    Operator,
    OperatorAtWork,
)
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.setpoint_limits import Limits


@pytest.fixture(scope='module')
def limits() -> Limits:
    return Limits.of(demo_scenario().rig)


def order(limits: Limits, share: float) -> WellRates:
    return limits.setpoint(np.array([share * limits.max_rate, 0.0, 0.0]))


def test_a_prompt_operator_sets_an_order_once(limits: Limits) -> None:
    person = OperatorAtWork(Operator(), limits, seed=1)
    first = order(limits, 0.5)
    assert person.follow(first) == (first, True)
    assert person.follow(first) == (first, False)


def test_a_late_operator_sets_the_order_of_photographs_ago(limits: Limits) -> None:
    person = OperatorAtWork(Operator(late=2), limits, seed=1)
    orders = [order(limits, share) for share in (0.2, 0.4, 0.6)]
    followed = [person.follow(item) for item in orders]
    assert followed == [(limits.safe(), False), (limits.safe(), False), (orders[0], True)]


def test_a_slip_stays_within_the_limits(limits: Limits) -> None:
    person = OperatorAtWork(Operator(slips=1.0), limits, seed=1)
    rates, are_new = person.follow(order(limits, 1.0))
    assert are_new
    assert rates != order(limits, 1.0)
    assert not limits.violations(rates)


def test_after_a_refusal_nothing_is_set_for_some_photographs(limits: Limits) -> None:
    person = OperatorAtWork(Operator(refuses=1.0), limits, seed=1)
    asked = [person.follow(order(limits, 0.5)) for _ in range(REFUSAL_PHOTOGRAPHS + 2)]
    assert asked == [(limits.safe(), False)] * len(asked)


def test_the_same_seed_makes_the_same_mistakes(limits: Limits) -> None:
    people = [OperatorAtWork(Operator(slips=0.5), limits, seed=4) for _ in range(2)]
    orders = [order(limits, share) for share in np.linspace(0.0, 1.0, 20)]
    assert [people[0].follow(item) for item in orders] == [
        people[1].follow(item) for item in orders
    ]
