"""Forecasts: prediction, correction and corrected prediction (paper, section 2.4).

The models are callables: local objects in tests and benchmarks, service clients in the graph.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.correction import Correction, CorrectionFn
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRates, mean_rates


class ModelUnavailable(Exception):  # noqa: N818  it is a state of the graph, not a mistake
    """A model did not answer; the message names the model and the remedy."""


class PhysicsModel(Protocol):
    """The physics-based model; maps are (nz, nx), `time_step` is in seconds."""

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the prediction c~^(n+1) (nz, nx) [-], which solves L c = f_c.

        Raises:
            ModelUnavailable: the model does not answer.
        """
        ...

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the corrected prediction c^(n+1) (nz, nx) [-], which solves L c = f_c + sigma.

        `sigma` (nz, nx) [1/s] is the corrective source term.

        Raises:
            ModelUnavailable: the model does not answer.
        """
        ...


def no_correction(*_: object) -> Correction:
    """Return no correction: the loop without a data-driven model."""
    return Correction(None, 'no data-driven model')


@dataclass(frozen=True)
class Forecast:
    """The expected state at `time` [s], from the state at `start` [s], under `rates`.

    `predicted` is the prediction of the physics-based model, `corrected` the corrected prediction,
    both (nz, nx) [-]. Without a correction (`is_corrected` False) they are equal, and
    `correction_status` says why. `rates` are the mean rates if they changed in between. `learnt` is
    the physics that the correction stands for.
    """

    start: float
    time: float
    rates: WellRates
    predicted: FloatArray
    corrected: FloatArray
    correction_status: str
    is_corrected: bool
    learnt: LearntPhysics = NO_LEARNT_PHYSICS


class Forecaster:
    """Makes forecasts from a physics-based and a data-driven model."""

    def __init__(self, physics: PhysicsModel, data_driven: CorrectionFn) -> None:
        """Use `physics` and correct it by `data_driven`, which may be `no_correction`."""
        self._physics = physics
        self._data_driven = data_driven

    def forecast(
        self,
        state: FloatArray,
        periods: Sequence[RatePeriod],
        durations: dict[str, float] | None = None,
    ) -> Forecast:
        """Return the forecast from `state` (nz, nx) over consecutive `periods`.

        The data-driven model knows one rate per well and interval, so it is asked once, with the
        mean rates; its sigma holds over all periods.

        Args:
            state: the concentration at the start of the first period.
            periods: the rates, without gaps in time.
            durations: receives the wall-clock times [s] of 'predict' and 'correct'.

        Raises:
            ModelUnavailable: the physics-based model does not answer.
        """
        durations = {} if durations is None else durations
        start, end = periods[0].start, periods[-1].end
        rates = periods[0].rates if len(periods) == 1 else mean_rates(periods)
        clock = time.perf_counter
        begin = clock()
        predicted = state
        for period in periods:
            predicted = self._physics.predict(predicted, period.rates, period.end - period.start)
        durations['predict'] = clock() - begin
        begin = clock()
        correction = self._data_driven(predicted, rates, end - start, state)
        corrected = predicted
        for number, period in enumerate(periods):
            before = state if number == 0 else corrected
            corrected = correction.applied_to(predicted, partial(self._correct, before, period))
        durations['correct'] = clock() - begin
        return Forecast(
            start,
            end,
            rates,
            predicted,
            corrected,
            correction.status,
            correction.applied,
            correction.learnt,
        )

    def _correct(self, previous: FloatArray, period: RatePeriod, sigma: FloatArray) -> FloatArray:
        return self._physics.correct(previous, sigma, period.rates, period.end - period.start)
