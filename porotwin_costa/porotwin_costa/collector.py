"""Turns a stream of states and measured rates into training pairs, one experiment at a time."""

import math
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, fill_unseen
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule, WellRate, WellRates
from porotwin_costa.dataset import (
    TIME_STEP_TOLERANCE,
    TOO_LITTLE_SEEN,
    Dataset,
    empty_dataset,
    enough_seen,
    mean_rates,
    rate_vector,
)

_KEPT = 64
"""Measured rates and interruptions that are remembered: far more than two photographs need."""


_LATE = 0.1
"""Share of a time step by which the first measured rates may begin after a pair's first state."""


@dataclass(frozen=True)
class Pair:
    """Two consecutive states (nz, nx), the rates between them, and when they end [s].

    Unseen cells are NaN. A prediction made before an interruption, or before the clock jumped back,
    says nothing about a pair of a later `course` of time.
    """

    previous: FloatArray
    following: FloatArray
    rates: dict[str, WellRate]
    end: float
    experiment: int
    course: int


_SampleValue = Callable[[Pair, FloatArray, FloatArray], object]


class Collector:
    """Pairs consecutive states and gathers what the physics-based model says of each pair.

    A pair is given out when the next state arrives: by then the rates measured between its states
    and any interruption are known. Messages of different topics may overtake each other, so that
    only their times count.
    """

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        time_step: float,
        *,
        first_experiment: int = 0,
        preset: str = '',
    ) -> None:
        """Collect pairs `time_step` [s] apart on `grid`; experiments count from a number.

        `preset` names the scheme of the physics-based model; empty: not known.
        """
        self._empty = empty_dataset(rig, grid, time_step, preset)
        self._experiment = first_experiment
        self._states: deque[tuple[float, FloatArray]] = deque(maxlen=2)
        self._told: deque[tuple[float, dict[str, WellRate]]] = deque(maxlen=_KEPT)
        self._clean: deque[float] = deque(maxlen=_KEPT)
        self._samples: list[tuple[Pair, FloatArray, FloatArray]] = []
        self._course = 0
        self._latest_prediction: tuple[int, FloatArray] | None = None
        self.dropped: Counter[str] = Counter()
        self.completed = 0

    def measured(self, start: float, rates: WellRates) -> None:
        """Remember that the wells pumped `rates` from `start` [s] on.

        Raises:
            InputError: an unknown well pumps.
        """
        rate_vector(rates, self._empty.wells)
        self._told.append((start, dict(rates)))

    def observed(self, time: float, concentration: FloatArray, grid: Grid) -> list[Pair]:
        """Take the state at `time` [s]; return the pair that the two states before it make.

        Raises:
            InputError: the state is on another grid.
        """
        if grid != self._empty.grid:
            raise InputError(f'state on {grid}: training data are on {self._empty.grid}')
        if self._states and time <= self._states[-1][0]:
            self._forget_after(time)
        ready = self._ready()
        self._states.append((time, concentration))
        return ready

    def interrupted(self, time: float) -> None:
        """Remember that what is seen from `time` [s] on does not follow from what was before."""
        self._clean.append(time)

    def finished(self) -> list[Pair]:
        """Return the pair that would else wait for the next state."""
        return self._ready()

    def start(self, pair: Pair) -> FloatArray:
        """Return the state (nz, nx) from which to predict: unseen cells as last predicted."""
        course, prediction = self._latest_prediction or (pair.course, None)
        return fill_unseen(pair.previous, prediction if course == pair.course else None)

    def complete(self, pair: Pair, predicted: FloatArray, residual: FloatArray) -> None:
        """Keep a pair with its prediction c~ (nz, nx) and exact residual r (nz, nx) [1/s].

        Both from `start` to `fill_unseen(following, predicted)`; pairs are completed in order.
        """
        if not (np.isfinite(predicted).all() and np.isfinite(residual).all()):
            self.dropped['pairs without finite residual'] += 1
            return
        self._latest_prediction = pair.course, predicted
        residual = np.where(np.isfinite(pair.following), residual, 0.0)
        self._samples.append((pair, predicted, residual))
        self.completed += 1

    @property
    def untaken(self) -> int:
        """Number of complete samples that `take` would return."""
        return len(self._samples)

    def take(self) -> Dataset:
        """Return the complete samples since the last call, which are then forgotten."""
        samples, self._samples = self._samples, []

        def stack(value: _SampleValue, like: np.ndarray) -> np.ndarray:
            values = [value(*sample) for sample in samples]
            return np.array(values, like.dtype).reshape(len(samples), *like.shape[1:])

        empty = self._empty
        return replace(
            empty,
            predicted=stack(lambda _, predicted, __: predicted, empty.predicted),
            rates=stack(lambda pair, *_: rate_vector(pair.rates, empty.wells), empty.rates),
            residual=stack(lambda _, __, residual: residual, empty.residual),
            time=stack(lambda pair, *_: pair.end, empty.time),
            experiment=stack(lambda pair, *_: pair.experiment, empty.experiment),
        )

    def _forget_after(self, time: float) -> None:
        """Begin anew, because the clock has jumped back to `time`."""
        self._states.clear()
        self._experiment += 1
        self._course += 1
        self._told = deque((item for item in self._told if item[0] <= time), maxlen=_KEPT)
        self._clean = deque((moment for moment in self._clean if moment <= time), maxlen=_KEPT)

    def _ready(self) -> list[Pair]:
        if len(self._states) < 2:
            return []
        (start, previous), (end, following) = self._states
        self._states.popleft()
        if any(start < clean <= end for clean in self._clean):
            self.dropped['pairs across an interruption'] += 1
            self._experiment += 1
            self._course += 1
            return []
        if not math.isclose(end - start, self._empty.time_step, rel_tol=TIME_STEP_TOLERANCE):
            self.dropped[f'pairs not {self._empty.time_step:g} s apart'] += 1
            self._experiment += 1
            return []
        if not (enough_seen(previous) and enough_seen(following)):
            self.dropped[TOO_LITTLE_SEEN] += 1
            return []
        known_from = min((time for time, _ in self._told), default=math.inf)
        if known_from > start + _LATE * self._empty.time_step:
            self.dropped['pairs without measured rates'] += 1
            return []
        rates = mean_rates(Schedule.from_rates(self._told), max(start, known_from), end)
        return [Pair(previous, following, rates, end, self._experiment, self._course)]
