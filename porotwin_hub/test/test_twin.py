"""The loop with models that are plain functions: what it decides, forecasts and survives."""

import math
from pathlib import Path

import numpy as np
import pytest

from porotwin_core.grid import FloatArray
from porotwin_core.rig import Rig, parse_rig
from porotwin_core.units import from_ml_h, to_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_hub.control import Limits
from porotwin_hub.objective import Objective
from porotwin_hub.twin import (
    Correction,
    ModelUnavailable,
    Observation,
    Twin,
    no_correction,
)

RIG: Rig = parse_rig(
    {
        'name': 'toy',
        'width_m': 1.0,
        'height_m': 0.5,
        'depth_m': 0.01,
        'porosity': 0.4,
        'permeability_m2': 1e-9,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {
            name: {'x_m': x, 'z_m': 0.2}
            for name, x in [('injector', 0.2), ('push', 0.5), ('producer', 0.8)]
        },
        'control': {
            'wells': ['push'],
            'producer': 'producer',
            'fixed': {'injector': {'rate_ml_h': 500.0, 'concentration': 1.0}},
            'disallowed_zone_m': [[0, 0.4], [1, 0.4], [1, 0.5], [0, 0.5]],
            'fuzziness_m': 0.0,
        },
    },
    Path('rig.yaml'),
)
GRID = RIG.grid(20, 10)
LIMITS = Limits.of(RIG)


class Toy:
    """Tracer appears in the zone at a rate that falls with the push; sigma adds to it."""

    def __init__(self) -> None:
        self.there = True
        self.calls = 0

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        self.calls += 1
        if not self.there:
            raise ModelUnavailable('the solver does not answer; start it')
        push = to_ml_h(rates['push'].rate)
        return concentration + time_step * 1e-4 * (1.0 + (push - 300.0) ** 2 / 3e5)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        return self.predict(previous, rates, time_step) + time_step * sigma


def make_twin(physics: Toy, *, data_driven: 'object' = no_correction, control: bool = True) -> Twin:
    return Twin(
        physics,
        data_driven,  # type: ignore[arg-type]
        GRID,
        photo_interval=30.0,
        horizon=600.0,
        evaluations=40,
        limits=LIMITS if control else None,
        objective=Objective(RIG, GRID) if control else None,
    )


def empty(time: float) -> Observation:
    return Observation(time, np.zeros(GRID.shape))


def test_a_state_leads_to_the_best_setpoint_and_a_forecast_with_it() -> None:
    cycle = make_twin(Toy()).cycle(empty(0.0), None)
    assert cycle.setpoint is not None
    assert cycle.forecast is not None
    assert to_ml_h(cycle.setpoint.rates['push'].rate) == pytest.approx(300.0, abs=6.0)
    assert cycle.setpoint.valid_until == 90.0
    assert (cycle.forecast.start, cycle.forecast.time) == (0.0, 30.0)
    assert cycle.forecast.rates == cycle.setpoint.rates
    assert cycle.remarks == []


def test_the_forecast_is_judged_by_the_next_photograph() -> None:
    twin = make_twin(Toy())
    first = twin.cycle(empty(0.0), None)
    assert math.isnan(first.prediction_error)
    assert first.forecast is not None
    observed = first.forecast.predicted * 1.25
    second = twin.cycle(Observation(30.0, observed), None)
    assert second.prediction_error == pytest.approx(0.2)


def test_a_photograph_at_another_time_is_judged_by_a_forecast_for_that_time() -> None:
    physics = Toy()
    twin = make_twin(physics)
    first = twin.cycle(empty(0.0), None)
    assert first.setpoint is not None
    exact = physics.predict(np.zeros(GRID.shape), first.setpoint.rates, 75.0)
    late = twin.cycle(Observation(75.0, exact), None)
    assert late.prediction_error == pytest.approx(0.0, abs=1e-12)


def test_after_an_interruption_nothing_is_judged() -> None:
    twin = make_twin(Toy())
    twin.cycle(empty(0.0), None)
    twin.interrupt()
    assert math.isnan(twin.cycle(Observation(30.0, np.ones(GRID.shape)), None).prediction_error)


def test_a_perfect_correction_makes_the_corrected_error_vanish() -> None:
    def perfect(*_: object) -> Correction:
        return Correction(np.full(GRID.shape, 1e-3), 'perfect')

    physics = Toy()
    twin = make_twin(physics, data_driven=perfect)
    first = twin.cycle(empty(0.0), None)
    assert first.forecast is not None
    truth = first.forecast.predicted + 30.0 * 1e-3
    second = twin.cycle(Observation(30.0, truth), None)
    assert second.corrected_error == pytest.approx(0.0, abs=1e-12)
    assert second.prediction_error > 0.5


def test_without_a_solver_the_setpoint_is_held_while_valid_and_then_safe() -> None:
    physics = Toy()
    twin = make_twin(physics)
    good = twin.cycle(empty(0.0), None).setpoint
    assert good is not None
    physics.there = False
    held = twin.cycle(empty(60.0), None)
    assert held.setpoint is not None
    assert held.setpoint.rates == good.rates
    assert held.setpoint.valid_until == good.valid_until
    assert any('solver does not answer' in remark for remark in held.remarks)
    late = twin.cycle(empty(120.0), None)
    assert late.setpoint is not None
    assert late.setpoint.rates == LIMITS.safe()
    physics.there = True
    again = twin.cycle(empty(150.0), None)
    assert again.setpoint is not None
    assert again.setpoint.rates == good.rates


def test_after_time_went_back_no_setpoint_is_held() -> None:
    physics = Toy()
    twin = make_twin(physics)
    twin.cycle(empty(3600.0), None)
    physics.there = False
    twin.begin_anew()
    first = twin.cycle(empty(0.0), None)
    assert first.setpoint is not None
    assert first.setpoint.rates == LIMITS.safe()
    assert first.setpoint.valid_until == 90.0


def test_a_setpoint_is_decided_before_any_forecast_is_asked_for() -> None:
    asked: list[float] = []

    def correction(*_: object) -> Correction:
        asked.append(0.0)
        return Correction(None, 'silent')

    twin = make_twin(Toy(), data_driven=correction)
    cycle = twin.decide(empty(0.0), None)
    assert cycle.setpoint is not None
    assert (cycle.forecast, asked) == (None, [])
    twin.look_ahead(cycle)
    assert cycle.forecast is not None
    assert cycle.forecast.rates == cycle.setpoint.rates


def test_a_state_too_old_to_act_on_is_forecast_and_judged_without_a_setpoint() -> None:
    twin = make_twin(Toy())
    twin.cycle(empty(0.0), None)
    pumped = LIMITS.safe()
    late = twin.decide(empty(30.0), pumped, steer=False)
    twin.look_ahead(late)
    assert (late.setpoint, late.decision) == (None, None)
    assert math.isfinite(late.disallowed_tracer)
    assert late.forecast is not None
    assert late.forecast.rates == pumped


def test_without_control_the_twin_predicts_with_the_measured_rates() -> None:
    cycle = make_twin(Toy(), control=False).cycle(empty(0.0), LIMITS.safe())
    assert cycle.setpoint is None
    assert cycle.forecast is not None
    assert cycle.forecast.rates == LIMITS.safe()


def test_without_control_the_wells_pump_what_is_assumed_until_somebody_says() -> None:
    twin = Twin(
        Toy(),
        no_correction,
        GRID,
        photo_interval=30.0,
        horizon=600.0,
        evaluations=40,
        assumed=LIMITS.safe(),
    )
    assert twin.cycle(empty(0.0), None).pumped == LIMITS.safe()
    told = {'push': WellRate(from_ml_h(10.0))}
    assert twin.cycle(empty(30.0), told).pumped == told


def test_a_setpoint_that_the_rig_did_not_take_is_not_taken_as_pumped() -> None:
    twin = make_twin(Toy())
    first = twin.cycle(empty(0.0), None)
    assert first.setpoint is not None
    second = twin.decide(Observation(30.0, np.full(GRID.shape, 0.2)), None)
    twin.not_taken(second)
    twin.look_ahead(second)
    assert second.forecast is not None
    assert second.forecast.rates == second.pumped == first.setpoint.rates
    assert twin.cycle(empty(60.0), None).pumped == first.setpoint.rates
