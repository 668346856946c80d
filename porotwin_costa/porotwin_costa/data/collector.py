"""Training pairs from a stream of states and measured rates."""

from collections import Counter, deque
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_PHOTOGRAPH_S
from porotwin_core.geometry.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.wells import WellRate, mean_rates
from porotwin_core.rig import Rig
from porotwin_costa.data.dataset import Dataset, empty_dataset
from porotwin_costa.data.dataset_builder import TrainingSample, with_samples
from porotwin_costa.data.frames import (
    ACROSS_INTERRUPTION,
    TOO_LITTLE_SEEN,
    enough_seen,
    left_out,
    same_time_step,
    wrong_interval,
)

REMEMBERED = 64
"""Number of interruptions kept; a pair of photographs needs far fewer."""


@dataclass(frozen=True)
class Pair:
    """Two consecutive states, the rates between them, and the time of the second.

    `previous` and `following` are concentrations (nz, nx) [-]; unseen cells are NaN. `rates` holds
    the mean rate [m^3/s] of each well; `end` [s] is the time of `following`. `experiment` numbers
    the uninterrupted sequences of pairs. `sequence` counts interruptions and jumps of the clock: a
    prediction of one sequence says nothing about a state of another.
    """

    previous: FloatArray
    following: FloatArray
    rates: dict[str, WellRate]
    end: float
    experiment: int
    sequence: int


class Collector:
    """Pairs consecutive states, and keeps prediction and residual of each pair.

    A pair is returned when the next state arrives. By then the rates in force between its states
    and any interruption are known. Messages of different topics may overtake each other, so only
    their times count.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        time_step: float,
        rates: RateHistory,
        *,
        first_experiment: int = 0,
        preset: str = '',
    ) -> None:
        """Collect pairs of states.

        Args:
            rig: the rig of the physics-based model.
            grid: the grid of all states.
            time_step: time between the states of a pair [s].
            rates: the rates in force, which are told to it.
            first_experiment: number of the first experiment.
            preset: numerical scheme of the physics-based model; empty if unknown.
        """
        self._empty = empty_dataset(rig, grid, time_step, preset)
        self._experiment = first_experiment
        self._states: deque[tuple[float, FloatArray]] = deque(maxlen=2)
        self.rates = rates
        self._interruptions: deque[float] = deque(maxlen=REMEMBERED)
        self._samples: list[TrainingSample] = []
        self._sequence = 0
        self._latest_prediction: tuple[int, FloatArray] | None = None
        self.dropped: Counter[str] = Counter()
        """Number of pairs left out, by reason."""
        self.completed = 0
        """Number of samples so far."""

    @property
    def report(self) -> str:
        """One line: the number of samples so far, and of pairs left out with the reasons."""
        return f'{self.completed} training pairs so far; left out: {left_out(self.dropped)}'

    def observed(self, time: float, concentration: FloatArray, grid: Grid) -> list[Pair]:
        """Add the state (nz, nx) at `time` [s]; return the pair of the two states before it.

        Raises:
            InputError: the state is on another grid.
        """
        if grid != self._empty.grid:
            raise InputError(f'state on {grid}: training data are on {self._empty.grid}')
        if self._states and time <= self._states[-1][0]:
            self._forget_after(time)
        ready = self._ready()
        self.rates.reach(time)
        self._states.append((time, concentration))
        return ready

    def interrupted(self, time: float) -> None:
        """Note that states from `time` [s] on do not follow from those before."""
        self._interruptions.append(time)

    def finished(self) -> list[Pair]:
        """Return the last pair, which otherwise waits for the next state."""
        return self._ready()

    def start_state(self, pair: Pair) -> FloatArray:
        """Return the state (nz, nx) to predict from: unseen cells as in the last prediction."""
        sequence, prediction = self._latest_prediction or (pair.sequence, None)
        return fill_unseen(pair.previous, prediction if sequence == pair.sequence else None)

    def complete(self, pair: Pair, predicted: FloatArray, residual: FloatArray) -> bool:
        """Add the prediction c~ (nz, nx) and the exact residual r (nz, nx) [1/s] of a pair.

        Both belong to the step from `start_state` to `fill_unseen(following, predicted)`. Pairs
        must be completed in their order. Returns False if a value is not finite, so that the pair
        is left out.
        """
        if not (np.isfinite(predicted).all() and np.isfinite(residual).all()):
            self.dropped['pairs without finite residual'] += 1
            return False
        self._latest_prediction = pair.sequence, predicted
        residual = np.where(np.isfinite(pair.following), residual, 0.0)
        self._samples.append(
            TrainingSample(predicted, residual, pair.rates, pair.end, pair.experiment)
        )
        self.completed += 1
        return True

    @property
    def waiting(self) -> int:
        """Number of samples that `take` would return."""
        return len(self._samples)

    def take(self) -> Dataset:
        """Return the samples since the last call."""
        samples, self._samples = self._samples, []
        return with_samples(self._empty, samples)

    def _forget_after(self, time: float) -> None:
        """Begin another experiment, because the clock has jumped back to `time`."""
        self._states.clear()
        self._experiment += 1
        self._sequence += 1
        self.rates.begin_anew(time)
        self._interruptions = deque(
            (moment for moment in self._interruptions if moment <= time), maxlen=REMEMBERED
        )

    def _ready(self) -> list[Pair]:
        """Return the pair of the two states that are kept, if it can be used."""
        if len(self._states) < 2:
            return []
        (start, previous), (end, following) = self._states
        self._states.popleft()
        begins = self.rates.begins
        periods = self.rates.periods(start, end)
        self.rates.forget_before(end)
        time_step = self._empty.time_step
        if any(start < moment <= end for moment in self._interruptions):
            self.dropped[ACROSS_INTERRUPTION] += 1
            self._experiment += 1
            self._sequence += 1
            return []
        if not same_time_step(end - start, time_step):
            self.dropped[wrong_interval(time_step)] += 1
            self._experiment += 1
            return []
        if not (enough_seen(previous) and enough_seen(following)):
            self.dropped[TOO_LITTLE_SEEN] += 1
            return []
        if begins is None or begins > start + SAME_PHOTOGRAPH_S:
            self.dropped['pairs without known rates'] += 1
            return []
        mean = mean_rates(periods)
        return [Pair(previous, following, mean, end, self._experiment, self._sequence)]
