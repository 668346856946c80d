"""Tests of forecasts over one or several periods of rates."""

import numpy as np
import pytest
from hub_examples import ToyModel

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.correction import Correction
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_hub.models.forecast import Forecaster, ModelUnavailable, no_correction


def push(rate_ml_h: float) -> dict[str, WellRate]:
    return {'push': WellRate(from_ml_h(rate_ml_h))}


def test_without_a_correction_both_predictions_are_equal(
    toy_model: ToyModel, toy_grid: Grid
) -> None:
    state = np.zeros(toy_grid.shape)
    forecast = Forecaster(toy_model, no_correction).forecast(
        state, [RatePeriod(10.0, 40.0, push(300.0))]
    )
    np.testing.assert_allclose(forecast.predicted, 30.0 * 1e-4)
    assert forecast.corrected is forecast.predicted
    assert (forecast.start, forecast.time, forecast.is_corrected) == (10.0, 40.0, False)
    assert forecast.correction_status == 'no data-driven model'


def test_a_forecast_over_several_periods_is_as_good_as_one_after_the_other(
    toy_model: ToyModel, toy_grid: Grid
) -> None:
    state = np.zeros(toy_grid.shape)
    first, second = RatePeriod(0.0, 12.0, push(0.0)), RatePeriod(12.0, 30.0, push(300.0))
    forecast = Forecaster(toy_model, no_correction).forecast(state, [first, second])
    halfway = toy_model.predict(state, first.rates, 12.0)
    np.testing.assert_array_equal(
        forecast.predicted, toy_model.predict(halfway, second.rates, 18.0)
    )
    assert forecast.rates['push'].rate == pytest.approx(from_ml_h(180.0))


def test_the_data_driven_model_is_asked_once_for_the_whole_interval(
    toy_model: ToyModel, toy_grid: Grid
) -> None:
    requests: list[tuple[float, float]] = []

    def constant(_: FloatArray, rates: WellRates, time_step: float, *__: object) -> Correction:
        requests.append((rates['push'].rate, time_step))
        return Correction(np.full(toy_grid.shape, 1e-3), 'constant')

    periods = [RatePeriod(0.0, 10.0, push(0.0)), RatePeriod(10.0, 30.0, push(300.0))]
    forecast = Forecaster(toy_model, constant).forecast(np.zeros(toy_grid.shape), periods)
    assert requests == [(pytest.approx(from_ml_h(200.0)), 30.0)]
    np.testing.assert_allclose(forecast.corrected, forecast.predicted + 30.0 * 1e-3)


def test_a_correction_that_overshoots_is_clipped(toy_model: ToyModel, toy_grid: Grid) -> None:
    def huge(*_: object) -> Correction:
        return Correction(np.full(toy_grid.shape, 1.0), 'huge')

    forecast = Forecaster(toy_model, huge).forecast(
        np.zeros(toy_grid.shape), [RatePeriod(0.0, 30.0, push(300.0))]
    )
    assert forecast.corrected.max() == 1.0


def test_a_model_that_does_not_answer_is_an_error(toy_model: ToyModel, toy_grid: Grid) -> None:
    toy_model.available = False
    with pytest.raises(ModelUnavailable, match='does not answer'):
        Forecaster(toy_model, no_correction).forecast(
            np.zeros(toy_grid.shape), [RatePeriod(0.0, 30.0, push(300.0))]
        )
