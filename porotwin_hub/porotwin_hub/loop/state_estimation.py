"""The state that predictions start from: the photograph, or a filter of photograph and forecast."""

from porotwin_core.geometry.grid import FloatArray, fill_unseen
from porotwin_core.model.state_filter import Estimate, Seen, StateFilter
from porotwin_core.rates.delivered_rates import USUAL_PUMP
from porotwin_core.rates.rate_periods import injected_tracer
from porotwin_core.rig import Rig
from porotwin_hub.estimation.rate_learning import RateLearner
from porotwin_hub.loop.cycle import Cycle
from porotwin_hub.models.forecast import Forecast
from porotwin_solver.effects import tracer_storage


class StateEstimation:
    """Estimates one state after the other.

    Attributes:
        estimate: the last one by the filter; None: there is none.
    """

    def __init__(self, state_filter: StateFilter | None, learner: RateLearner | None) -> None:
        """Estimate by `state_filter`.

        Args:
            state_filter: weighs photograph and forecast; None: the state is the photograph, its
                unseen cells filled in (the paper's way).
            learner: knows how sure the rate of the tracer's pump is; None: as sure as usual.
        """
        self._filter = state_filter
        self._learner = learner
        self.estimate: Estimate | None = None
        self._expected: FloatArray | None = None

    def change_model(self, mended: Rig) -> None:
        """Weigh tracer with the effects of the rig `mended` from now on."""
        if self._filter is not None:
            rows, columns = self._filter.pore_volume.shape
            self._filter.pore_volume = tracer_storage(mended, mended.grid(columns, rows))

    def interrupt(self) -> None:
        """Forget the last state: the next one does not follow from it."""
        self.estimate = None
        self._expected = None

    def expect(self, cycle: Cycle) -> None:
        """Fill the unseen cells of the next photograph from the forecast of `cycle`."""
        ahead = cycle.forecast
        self._expected = ahead.corrected if ahead is not None else cycle.state

    def estimate_state(self, cycle: Cycle) -> None:
        """Set the state of `cycle` from its observation and the forecast that was made for it."""
        observation, elapsed = cycle.observation, cycle.elapsed
        expected = elapsed.corrected if elapsed is not None else self._expected
        if self._filter is None:
            cycle.state = fill_unseen(observation.concentration, expected)
            return
        seen = Seen.of(observation.concentration, observation.deviation, observation.systematic)
        self.estimate = self._filtered(self._filter, cycle, seen, elapsed, expected)
        cycle.seen = seen
        cycle.state = self.estimate.concentration
        cycle.observed = self.estimate.observed
        cycle.expected_error = self.estimate.expected_error

    def _filtered(
        self,
        state_filter: StateFilter,
        cycle: Cycle,
        seen: Seen,
        elapsed: Forecast | None,
        expected: FloatArray | None,
    ) -> Estimate:
        if elapsed is None or self.estimate is None:
            return state_filter.begin(seen, expected)
        pump = USUAL_PUMP
        if self._learner is not None:
            pump = self._learner.tracer_factor(cycle.periods)
        return state_filter.update(
            self.estimate,
            elapsed.corrected,
            seen,
            injected_tracer(cycle.periods),
            pump.deviation,
            pump.factor,
        )
