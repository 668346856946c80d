"""Tests of the loop with models that are plain functions: decisions, forecasts, failures."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hub_examples import TOY, ToyModel

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.model.correction import Correction, CorrectionFn
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod
from porotwin_core.rates.wells import WellRate, WellRates, net_rate
from porotwin_core.rig import EffectDescription
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.optimisation import Decision
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction

SHAPE = (10, 20)
"""Shape of the toy grid, (nz, nx)."""

MakeTwin = Callable[..., Twin]


@pytest.fixture
def make_twin(toy_model: ToyModel, toy_controller: Controller) -> MakeTwin:
    """Return a function that makes a twin of the toy rig, with or without control."""

    def make(data_driven: CorrectionFn = no_correction, *, control: bool = True) -> Twin:
        controller = toy_controller if control else None
        return Twin(toy_model, data_driven, photo_interval=30.0, controller=controller)

    return make


def empty(time: float) -> Observation:
    return Observation(time, np.zeros(SHAPE))


def full(time: float, concentration: float) -> Observation:
    return Observation(time, np.full(SHAPE, concentration))


def test_a_state_leads_to_the_best_setpoint_and_a_forecast_with_it(make_twin: MakeTwin) -> None:
    cycle = make_twin().cycle(empty(0.0))
    assert cycle.setpoint is not None
    assert cycle.forecast is not None
    assert to_ml_h(cycle.setpoint.rates['push'].rate) == pytest.approx(300.0, abs=6.0)
    assert cycle.setpoint.valid_until == 90.0
    assert (cycle.forecast.start, cycle.forecast.time) == (0.0, 30.0)
    assert cycle.forecast.rates == cycle.setpoint.rates
    assert cycle.remarks == []


def test_the_forecast_is_judged_by_the_next_photograph(make_twin: MakeTwin) -> None:
    twin = make_twin()
    first = twin.cycle(empty(0.0))
    assert math.isnan(first.prediction_error)
    assert first.forecast is not None
    observed = first.forecast.predicted * 1.25
    second = twin.cycle(Observation(30.0, observed))
    assert second.prediction_error == pytest.approx(0.2)


def test_a_photograph_at_another_time_is_judged_by_a_forecast_for_that_time(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin()
    first = twin.cycle(empty(0.0))
    assert first.setpoint is not None
    exact = toy_model.predict(np.zeros(SHAPE), first.setpoint.rates, 75.0)
    late = twin.cycle(Observation(75.0, exact))
    assert late.prediction_error == pytest.approx(0.0, abs=1e-12)


def test_after_an_interruption_nothing_is_judged(make_twin: MakeTwin) -> None:
    twin = make_twin()
    twin.cycle(empty(0.0))
    twin.interrupt()
    assert math.isnan(twin.cycle(Observation(30.0, np.ones(SHAPE))).prediction_error)


def test_a_perfect_correction_makes_the_corrected_error_vanish(make_twin: MakeTwin) -> None:
    def perfect(*_: object) -> Correction:
        return Correction(np.full(SHAPE, 1e-3), 'perfect')

    twin = make_twin(perfect)
    first = twin.cycle(empty(0.0))
    assert first.forecast is not None
    truth = first.forecast.predicted + 30.0 * 1e-3
    second = twin.cycle(Observation(30.0, truth))
    assert second.corrected_error == pytest.approx(0.0, abs=1e-12)
    assert second.prediction_error > 0.5


def test_a_decision_uses_the_learnt_physics_while_corrections_are_applied(
    make_twin: MakeTwin, toy_controller: Controller
) -> None:
    learnt, asked = (
        LearntPhysics(
            (EffectDescription(name='buoyancy', parameters={'density_difference': 0.8}),)
        ),
        [],
    )
    answers = iter([Correction(np.zeros(SHAPE), 'applied', learnt), Correction(None, 'withheld')])

    class Listening:
        limits, objective = toy_controller.limits, toy_controller.objective

        def decide(self, *state: Any, **known: Any) -> Decision:
            asked.append(known['plant'].learnt)
            return toy_controller.decide(*state, **known)

    twin = make_twin(lambda *_: next(answers))
    twin.change_controller(Listening())
    for time in (0.0, 30.0, 60.0):
        cycle = twin.decide(empty(time))
        if time < 60.0:
            twin.look_ahead(cycle)
    assert asked == [NO_LEARNT_PHYSICS, learnt, NO_LEARNT_PHYSICS]


def test_without_a_solver_the_setpoint_is_held_while_valid_and_then_safe(
    make_twin: MakeTwin, toy_model: ToyModel, toy_limits: Limits
) -> None:
    twin = make_twin()
    good = twin.cycle(empty(0.0)).setpoint
    assert good is not None
    toy_model.available = False
    held = twin.cycle(empty(60.0))
    assert held.setpoint is not None
    assert held.setpoint.rates == good.rates
    assert held.setpoint.valid_until == good.valid_until
    assert any('solver does not answer' in remark for remark in held.remarks)
    late = twin.cycle(empty(120.0))
    assert late.setpoint is not None
    assert late.setpoint.rates == toy_limits.safe()
    toy_model.available = True
    again = twin.cycle(empty(150.0))
    assert again.setpoint is not None
    assert again.setpoint.rates == good.rates


def test_a_setpoint_that_ended_since_the_last_photograph_was_pumped_until_then(
    make_twin: MakeTwin, toy_limits: Limits
) -> None:
    twin = make_twin()
    setpoint = twin.cycle(empty(0.0)).setpoint
    assert setpoint is not None
    cycle = twin.cycle(empty(100.0))  # photographs were lost
    assert cycle.periods == (
        RatePeriod(0.0, 90.0, setpoint.rates),
        RatePeriod(90.0, 100.0, toy_limits.safe()),
    )
    assert cycle.pumped == toy_limits.safe()


def test_a_setpoint_that_ends_at_the_photograph_is_not_held(
    make_twin: MakeTwin, toy_model: ToyModel, toy_limits: Limits
) -> None:
    twin = make_twin()
    good = twin.cycle(empty(0.0)).setpoint
    assert good is not None
    toy_model.available = False
    setpoint = twin.cycle(empty(good.valid_until)).setpoint
    assert setpoint is not None
    assert setpoint.rates == toy_limits.safe()
    assert setpoint.valid_until > good.valid_until


def test_after_time_went_back_no_setpoint_is_held(
    make_twin: MakeTwin, toy_model: ToyModel, toy_limits: Limits
) -> None:
    twin = make_twin()
    twin.cycle(empty(3600.0))
    toy_model.available = False
    twin.begin_anew()
    first = twin.cycle(empty(0.0))
    assert first.setpoint is not None
    assert first.setpoint.rates == toy_limits.safe()
    assert first.setpoint.valid_until == 90.0


def test_a_setpoint_is_decided_before_any_forecast_is_made(make_twin: MakeTwin) -> None:
    requests: list[float] = []

    def correction(*_: object) -> Correction:
        requests.append(0.0)
        return Correction(None, 'silent')

    twin = make_twin(correction)
    cycle = twin.decide(empty(0.0))
    assert cycle.setpoint is not None
    assert (cycle.forecast, requests) == (None, [])
    twin.look_ahead(cycle)
    assert cycle.forecast is not None
    assert cycle.forecast.rates == cycle.setpoint.rates


def test_an_order_counts_as_set_until_somebody_tells_when_it_was(
    make_twin: MakeTwin, toy_limits: Limits
) -> None:
    twin = make_twin()
    first = twin.cycle(empty(0.0)).setpoint
    assert first is not None
    unknown = twin.cycle(empty(30.0))
    assert unknown.pumped == first.rates
    told = twin.cycle(empty(60.0), [KnownRates(45.0, 45.0, first.rates)])
    assert told.periods == (
        RatePeriod(30.0, 45.0, toy_limits.safe()),
        RatePeriod(45.0, 60.0, first.rates),
    )


@pytest.mark.parametrize('interrupted', [False, True])
def test_an_order_that_nobody_has_set_yet_is_none_after_an_interruption_either(
    make_twin: MakeTwin, toy_controller: Controller, interrupted: bool
) -> None:
    class Ordering:
        limits, objective = toy_controller.limits, toy_controller.objective

        def decide(self, *_: Any, **__: Any) -> Decision:
            rates = self.limits.setpoint(np.array([from_ml_h(100.0)]))
            return Decision(rates, cost=0.0, cost_unchanged=0.0, evaluations=0)

    twin = make_twin()
    first = twin.cycle(empty(0.0)).setpoint
    assert first is not None
    twin.cycle(empty(30.0), [KnownRates(20.0, 20.0, first.rates)])  # a person tells it
    twin.change_controller(Ordering())
    order = twin.cycle(empty(60.0)).setpoint
    assert order is not None
    assert order.rates != first.rates
    if interrupted:
        twin.interrupt()
    assert twin.cycle(empty(90.0)).pumped == first.rates
    told = twin.cycle(empty(120.0), [KnownRates(110.0, 110.0, order.rates)])
    assert [period.rates for period in told.periods] == [first.rates, order.rates]


def test_a_state_too_old_to_act_on_is_forecast_and_judged_without_a_setpoint(
    make_twin: MakeTwin, toy_limits: Limits
) -> None:
    twin = make_twin()
    twin.cycle(empty(0.0))
    pumped = toy_limits.safe()
    late = twin.decide(empty(30.0), [KnownRates(0.0, 30.0, pumped)], actuate=False)
    twin.look_ahead(late)
    assert (late.setpoint, late.decision) == (None, None)
    assert math.isfinite(late.disallowed_tracer)
    assert late.forecast is not None
    assert late.forecast.rates == pumped


def test_without_control_the_twin_predicts_with_the_measured_rates(
    make_twin: MakeTwin, toy_limits: Limits
) -> None:
    known = [KnownRates(-30.0, 0.0, toy_limits.safe())]
    cycle = make_twin(control=False).cycle(empty(0.0), known)
    assert cycle.setpoint is None
    assert cycle.forecast is not None
    assert cycle.forecast.rates == toy_limits.safe()


def test_without_control_the_assumed_rates_count_until_others_are_known(
    toy_model: ToyModel, toy_limits: Limits
) -> None:
    twin = Twin(toy_model, no_correction, photo_interval=30.0, rates=RateHistory(toy_limits.safe()))
    assert twin.cycle(empty(0.0)).pumped == toy_limits.safe()
    known = {'push': WellRate(from_ml_h(10.0))}
    assert twin.cycle(empty(30.0), [KnownRates(12.0, 12.0, known)]).pumped == known
    assert twin.cycle(empty(60.0)).pumped == known


@pytest.mark.parametrize('time', [29.4, 29.7, 29.999])
def test_a_confirmation_just_before_a_photograph_holds_from_then_on(
    toy_model: ToyModel, toy_limits: Limits, time: float
) -> None:
    twin = Twin(toy_model, no_correction, photo_interval=30.0, rates=RateHistory(toy_limits.safe()))
    twin.cycle(empty(0.0))
    confirmed = {'push': WellRate(from_ml_h(10.0))}
    cycle = twin.cycle(empty(30.0), [KnownRates(time, time, confirmed)])
    assert cycle.pumped == confirmed
    assert cycle.forecast is not None
    assert cycle.forecast.rates == confirmed
    assert twin.cycle(empty(60.0)).periods[0].rates == confirmed


def test_after_control_is_switched_off_the_last_setpoint_holds_until_it_ends(
    toy_model: ToyModel, toy_controller: Controller, toy_limits: Limits
) -> None:
    safe = toy_limits.safe()
    twin = Twin(toy_model, no_correction, photo_interval=30.0, controller=toy_controller)
    last = twin.cycle(empty(0.0)).setpoint
    assert last is not None
    twin.change_controller(None)
    known = {'push': WellRate(from_ml_h(10.0))}
    told = {60.0: [KnownRates(40.0, 40.0, known)], 180.0: [KnownRates(170.0, 170.0, known)]}
    times = 30.0 * np.arange(1, 8)
    pumped = [twin.cycle(empty(time), told.get(time, ())).pumped for time in times]
    assert pumped == [last.rates, known, known, safe, safe, known, known]


def test_an_announced_pause_holds_where_no_rates_are_known(
    toy_model: ToyModel, toy_limits: Limits
) -> None:
    pauses = FixedPauses({'injector': ((45.0, 75.0),)}, toy_limits.fixed, toy_limits.producer)
    began = 1000.0
    rates = RateHistory(toy_limits.safe(), announced=pauses)
    twin = Twin(toy_model, no_correction, photo_interval=30.0, rates=rates)
    rests = {}
    for time in (0.0, 30.0, 60.0, 90.0):
        cycle = twin.cycle(empty(began + time))
        rests[time] = [period.rates['injector'].rate == 0.0 for period in cycle.periods]
        assert cycle.forecast is not None
        if time == 30.0:  # half of the next interval
            half = 0.5 * toy_limits.fixed['injector'].rate
            assert cycle.forecast.rates['injector'].rate == pytest.approx(half)
    assert rests == {0.0: [], 30.0: [False], 60.0: [False, True], 90.0: [True, False]}
    stopped = [KnownRates(began + 90.0, began + 120.0, {})]
    assert twin.cycle(empty(began + 120.0), stopped).pumped == {}
    rates = RateHistory(toy_limits.safe(), announced=pauses)
    rates.told_start = began
    restarted = Twin(toy_model, no_correction, photo_interval=30.0, rates=rates)
    assert restarted.cycle(empty(began + 60.0)).pumped['injector'].rate == 0.0


def test_a_setpoint_that_the_rig_rejects_does_not_count_as_pumped(make_twin: MakeTwin) -> None:
    twin = make_twin()
    first = twin.cycle(empty(0.0))
    assert first.setpoint is not None
    second = twin.decide(Observation(30.0, np.full(SHAPE, 0.2)))
    twin.choice.reject(second)
    twin.look_ahead(second)
    assert second.forecast is not None
    assert second.forecast.rates == second.pumped == first.setpoint.rates
    assert twin.cycle(empty(60.0)).pumped == first.setpoint.rates


def pushing(rate_ml_h: float) -> dict[str, WellRate]:
    """Return the rates of the toy rig with a push, balanced by the producer."""
    injector = TOY['control']['fixed']['injector']
    return {
        'injector': WellRate(from_ml_h(injector['rate_ml_h']), injector['concentration']),
        'push': WellRate(from_ml_h(rate_ml_h)),
        'producer': WellRate(-from_ml_h(injector['rate_ml_h'] + rate_ml_h)),
    }


def run_with_operator(
    twin: Twin, toy_model: ToyModel, pumped: WellRates, known: Callable[[float], list[KnownRates]]
) -> list[float]:
    """Return the prediction errors while a perfect rig pumps `pumped` instead of the setpoints.

    `known(start)` returns the rates that are known of the interval from `start` [s].
    """
    state = full(0.0, 0.1)
    twin.cycle(state)
    errors = []
    for number in range(1, 6):
        concentration = toy_model.predict(state.concentration, pumped, 30.0)
        state = Observation(30.0 * number, concentration)
        errors.append(twin.cycle(state, known(30.0 * (number - 1))).prediction_error)
    return errors


def test_the_model_is_not_blamed_for_an_operator_who_sets_something_else(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    pumped = pushing(0.0)
    blamed = run_with_operator(make_twin(), toy_model, pumped, lambda _: [])
    assert min(blamed) > 0.005
    judged = run_with_operator(
        make_twin(), toy_model, pumped, lambda start: [KnownRates(start, start + 30.0, pumped)]
    )
    assert max(judged) < 1e-12


def test_a_setpoint_that_is_followed_is_judged_by_its_own_forecast(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin()
    first = twin.cycle(empty(0.0))
    assert first.setpoint is not None
    assert first.forecast is not None
    steps = len(toy_model.steps)
    second = twin.decide(
        full(30.0, 0.01), [KnownRates(0.0, 30.0, first.setpoint.rates)], actuate=False
    )
    assert len(toy_model.steps) == steps
    twin.look_ahead(second)
    assert second.elapsed is first.forecast
    assert second.notes == []


def test_rates_that_change_within_the_interval_are_predicted_piece_by_piece(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin()
    first = twin.cycle(full(0.0, 0.1))
    assert first.setpoint is not None
    early = toy_model.predict(np.full(SHAPE, 0.1), pushing(50.0), 12.0)
    seen = Observation(30.0, toy_model.predict(early, first.setpoint.rates, 18.0))
    measured = [
        KnownRates(0.0, 12.0, pushing(50.0)),
        KnownRates(12.0, 30.0, first.setpoint.rates),
    ]
    cycle = twin.cycle(seen, measured)
    assert cycle.prediction_error < 1e-12
    assert len(cycle.periods) == 2


def test_until_the_operator_confirms_the_pumps_stay_as_they_were(
    make_twin: MakeTwin, toy_model: ToyModel, toy_limits: Limits
) -> None:
    twin = make_twin()
    first = twin.cycle(full(0.0, 0.1))
    assert first.setpoint is not None
    early = toy_model.predict(np.full(SHAPE, 0.1), toy_limits.safe(), 20.0)
    seen = Observation(30.0, toy_model.predict(early, first.setpoint.rates, 10.0))
    cycle = twin.cycle(seen, [KnownRates(20.0, 20.0, first.setpoint.rates)])
    assert [period.rates for period in cycle.periods] == [toy_limits.safe(), first.setpoint.rates]
    assert cycle.prediction_error < 1e-12


def test_a_repeated_forecast_is_noted_and_is_no_fault(make_twin: MakeTwin) -> None:
    twin = make_twin()
    twin.cycle(full(0.0, 0.1))
    cycle = twin.cycle(full(30.0, 0.1), [KnownRates(0.0, 30.0, pushing(0.0))])
    (note,) = cycle.notes
    assert note.startswith('predicted again with the rates in force: push 0.0 instead of ')
    assert cycle.remarks == []


def test_unseen_cells_are_estimated_with_the_rates_in_force(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin()
    twin.cycle(full(0.0, 0.1))
    blind = Observation(30.0, np.full(SHAPE, np.nan))
    cycle = twin.cycle(blind, [KnownRates(0.0, 30.0, pushing(0.0))])
    expected = toy_model.predict(np.full(SHAPE, 0.1), pushing(0.0), 30.0)
    np.testing.assert_array_equal(cycle.state, expected)


def test_without_a_solver_other_rates_are_one_remark(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin()
    twin.cycle(full(0.0, 0.1))
    toy_model.available = False
    cycle = twin.cycle(full(30.0, 0.1), [KnownRates(0.0, 30.0, pushing(0.0))])
    assert math.isnan(cycle.prediction_error)
    lines = [line for line in cycle.remarks if line.startswith('no prediction for this photograph')]
    assert len(lines) == 1


def test_without_control_other_rates_are_predicted_again_too(
    make_twin: MakeTwin, toy_model: ToyModel
) -> None:
    twin = make_twin(control=False)
    twin.cycle(full(0.0, 0.1))
    seen = toy_model.predict(np.full(SHAPE, 0.1), pushing(300.0), 30.0)
    cycle = twin.cycle(Observation(30.0, seen), [KnownRates(0.0, 30.0, pushing(300.0))])
    assert cycle.prediction_error < 1e-12


def test_a_setpoint_lets_the_wells_rest_that_pause(
    toy_model: ToyModel, toy_controller: Controller, toy_limits: Limits
) -> None:
    pauses = FixedPauses({'injector': ((45.0, 75.0),)}, toy_limits.fixed, toy_limits.producer)
    limits = replace(toy_limits, pausing=frozenset({'injector'}))
    controller = replace(toy_controller, limits=limits)
    rates = RateHistory(limits.safe(), announced=pauses)
    twin = Twin(toy_model, no_correction, photo_interval=30.0, controller=controller, rates=rates)
    found = {}
    for time in (0.0, 30.0, 60.0, 90.0):
        setpoint = twin.cycle(empty(time)).setpoint
        assert setpoint is not None
        assert 'optimised rates' not in setpoint.reason
        assert net_rate(setpoint.rates) == pytest.approx(0.0, abs=1e-15)
        found[time] = setpoint.rates['injector'].rate == 0.0
    assert found == {0.0: False, 30.0: False, 60.0: True, 90.0: False}
