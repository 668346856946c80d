"""Tests of the learning of rate factors, with a fake model that a rate shifts and fills."""

import numpy as np
import pytest

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.correction import Correction
from porotwin_core.model.state_filter import Estimate, Seen, Volume
from porotwin_core.rates.delivered_rates import RATE_DEVIATION, USUAL_PUMP
from porotwin_core.rates.rate_periods import KnownRates, RatePeriod, joined
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_hub.estimation.rate_learning import DeliveringModel, RateLearner
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin

GRID = Grid(30, 20, 0.3, 0.2)
RATE = 1e-7
TOLD = {'in': WellRate(RATE, 1.0), 'push': WellRate(RATE), 'rest': WellRate()}
PRIOR = dict.fromkeys(TOLD, RATE_DEVIATION)


class Fronts:
    """A model: 'in' moves a vertical front, 'push' a horizontal one, by 0.1 mm/s at RATE."""

    def __init__(self) -> None:
        self.calls = 0

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        self.calls += 1
        right, up = (1e-4 * time_step * rates[name].rate / RATE for name in ('in', 'push'))
        # the state holds the positions of its fronts: mean over rows and columns
        x, z = (
            concentration[0, :-1].sum() * GRID.dx + right,
            concentration[:, -1].sum() * GRID.dz + up,
        )
        return fronts(x, z)

    def correct(self, *_: object) -> FloatArray:
        raise NotImplementedError


def fronts(x: float, z: float) -> FloatArray:
    """Return tracer left of `x` [m] in the lower half row and below `z` [m] on the right."""
    along = np.clip((x - GRID.x) / (5 * GRID.dx) + 0.5, 0.0, 1.0)
    up = np.clip((z - GRID.z) / (5 * GRID.dz) + 0.5, 0.0, 1.0)
    result = np.maximum(along[None, :] * np.ones((20, 1)), up[:, None] * np.ones((1, 30)))
    result[0] = along
    result[:, -1] = up
    return result


def estimate(concentration: FloatArray) -> Estimate:
    volume = Volume(0.0, np.diag([0.0, 1e-4, 0.0]), 1.0)
    return Estimate(concentration, np.zeros(GRID.shape), volume, concentration)


def seen(concentration: FloatArray) -> Seen:
    return Seen(concentration, np.full(GRID.shape, 0.01), 0.02 * concentration)


def learnt(
    true: dict[str, float], seconds: int = 1200, *, interval: int = 60
) -> tuple[RateLearner, Fronts]:
    """Return a learner after photographs every `interval` [s] with `true` factors."""
    learner, model = RateLearner(PRIOR, GRID, closed=False), Fronts()
    speeds = [1e-4 * true.get(name, 1.0) for name in ('in', 'push')]
    for time in range(0, seconds + 1, interval):
        shown = fronts(0.06 + speeds[0] * time, 0.05 + speeds[1] * time)
        periods = (RatePeriod(float(time - interval), float(time), TOLD),) if time else ()
        learner.learn(model, float(time), estimate(shown), seen(shown), periods)
    return learner, model


def test_pumps_that_deliver_less_are_learnt() -> None:
    factors = learnt({'in': 0.9, 'push': 1.05})[0].factors
    assert factors['in'].factor == pytest.approx(0.9, abs=3 * factors['in'].deviation)
    assert factors['in'].factor < 0.95
    assert factors['push'].factor > 1.02
    assert factors['in'].deviation < 0.05


@pytest.mark.parametrize('interval', [700, 1000])
def test_photographs_further_apart_than_the_windows_teach_too(interval: int) -> None:
    factors = learnt({'in': 0.9}, seconds=3 * interval, interval=interval)[0].factors
    assert factors['in'].factor < 0.95


def test_a_well_at_rest_teaches_nothing() -> None:
    factors = learnt({})[0].factors
    assert factors['rest'] == pytest.approx(USUAL_PUMP)
    assert factors['in'].factor == pytest.approx(1.0, abs=0.02)


def test_a_prediction_for_each_pumping_well_is_asked_now_and_then() -> None:
    _, model = learnt({}, seconds=600)
    watched = 5 * (1 + 2 * 2)  # every two minutes: usual, two wells with nothing or twice as much
    assert model.calls == 2 * (1 + 2 + 1) + watched  # two updates: another scale beside these


def test_predictions_use_what_is_delivered() -> None:
    learner, model = learnt({'in': 0.9})
    state = fronts(0.06, 0.05)
    told = DeliveringModel(model, learner).predict(state, TOLD, 600.0)
    np.testing.assert_array_equal(told, model.predict(state, learner.delivered(TOLD), 600.0))


def test_a_twin_asks_both_models_with_what_is_delivered() -> None:
    learner, model, asked = RateLearner(PRIOR, GRID, closed=False), Fronts(), []
    learner.meter(TOLD, TOLD)
    learner.meter({**TOLD, 'in': WellRate(0.6 * RATE, 1.0)}, TOLD)
    told = KnownRates(0.0, 0.0, TOLD)

    def data_driven(
        predicted: FloatArray, rates: WellRates, time_step: float, previous: FloatArray
    ) -> Correction:
        expected = model.predict(previous, rates, time_step)
        np.testing.assert_array_equal(predicted, expected)
        asked.append(rates['in'].rate)
        return Correction(None, 'asked')

    twin = Twin(model, data_driven, photo_interval=60.0, learner=learner)
    twin.cycle(Observation(10.0, fronts(0.06, 0.05)), [told])
    assert asked == [pytest.approx(0.6 * RATE)]


def test_a_meter_tells_at_once() -> None:
    learner = RateLearner(PRIOR, GRID, closed=False)
    for _ in range(8):
        learner.meter({'in': WellRate(0.8 * RATE, 1.0), 'push': WellRate()}, TOLD)
    assert learner.factors['in'].factor == pytest.approx(0.8, abs=0.01)
    assert learner.factors['push'].factor < 0.05
    measured = learner.told({'in': WellRate(0.8 * RATE, 1.0)})
    assert measured['in'].rate == pytest.approx(RATE, rel=0.02)


def test_a_pump_that_stops_and_one_that_runs_again_are_believed_at_once() -> None:
    learner = RateLearner(PRIOR, GRID, closed=False)
    learner.meter(TOLD, TOLD)
    learner.meter({**TOLD, 'in': WellRate()}, TOLD)
    assert learner.factors['in'].factor < 0.05
    learner.meter(TOLD, TOLD)
    assert learner.factors['in'].factor == 1.0
    assert learner.told(TOLD) == TOLD


@pytest.mark.parametrize('earlier', [0, 1], ids=['first command', 'later command'])
def test_a_late_person_is_no_dead_pump_but_one_that_never_turns_is(earlier: int) -> None:
    learner = RateLearner(PRIOR, GRID, closed=False)
    off = {**TOLD, 'push': WellRate()}
    for _ in range(earlier):
        learner.meter(off, off)
    for _ in range(4):
        learner.meter(off, TOLD)
    assert learner.factors['push'].factor == 1.0
    for _ in range(4):
        learner.meter(off, TOLD)
    assert learner.factors['push'].factor < 0.05


def test_a_pump_at_rest_is_tried_again_after_a_while() -> None:
    learner = RateLearner(PRIOR, GRID, closed=False)
    off = {**TOLD, 'push': WellRate()}
    for _ in range(8):
        learner.meter(off, TOLD)
    assert learner.factors['push'].factor < 0.05
    for _ in range(30):
        learner.meter(off, off)
    assert learner.factors['push'].factor > 0.7


def test_a_metered_pause_teaches_nothing_about_the_time_before_it() -> None:
    learner, model = RateLearner(PRIOR, GRID, closed=False), Fronts()
    for time in range(0, 901, 60):
        pumped = TOLD if time <= 600 else {**TOLD, 'in': WellRate()}
        learner.meter(pumped, TOLD)
        told = {name: learner.told({name: well})[name] for name, well in pumped.items()}
        shown = fronts(0.06 + 1e-4 * min(time, 600), 0.05 + 1e-4 * time)
        periods = (RatePeriod(time - 60.0, float(time), told),) if time else ()
        learner.learn(model, float(time), estimate(shown), seen(shown), periods)
    learner.meter(TOLD, TOLD)
    assert learner.factors['in'].factor == pytest.approx(1.0, abs=0.03)


def test_a_changed_command_is_not_compared_with_its_meter() -> None:
    learner = RateLearner(PRIOR, GRID, closed=False)
    learner.meter({'in': WellRate(0.5 * RATE, 1.0)}, TOLD)
    assert learner.factors['in'].factor == 1.0


def test_an_interruption_keeps_what_was_learnt_and_a_new_beginning_does_not() -> None:
    learner, _ = learnt({'in': 0.9})
    learner.interrupt()
    assert learner.factors['in'].factor < 0.95
    learner.begin_anew()
    assert learner.factors['in'] == pytest.approx(USUAL_PUMP)


def test_periods_of_the_same_rates_are_joined() -> None:
    other = {**TOLD, 'in': WellRate(0.5 * RATE, 1.0)}
    periods = [RatePeriod(0.0, 1.0, TOLD), RatePeriod(1.0, 2.0, TOLD), RatePeriod(2.0, 3.0, other)]
    assert joined(periods) == [RatePeriod(0.0, 2.0, TOLD), RatePeriod(2.0, 3.0, other)]
