"""The state estimate: photograph and prediction, weighted in each cell by their errors.

A Kalman filter with one variance for each cell. Its gain is the share of the prediction's error in
the difference between photograph and prediction (Evensen et al., Data Assimilation Fundamentals,
2022, ch. 6). The filter learns the error of predictions from these differences. The volume of
tracer and the scale of the photographs follow from all photographs so far (`tracer_volume.py`). In
each cell the state lies between the prediction and the photograph without the error of its scale.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.optimize import nnls

from porotwin_core.geometry.grid import FloatArray, fill_unseen
from porotwin_core.model.tracer_volume import OUTLIER_DEVIATIONS, Balance, Volume
from porotwin_core.rates.delivered_rates import RATE_DEVIATION

USUAL_RANDOM = 0.015
"""Random deviation of a photograph that states none [-]."""

USUAL_SYSTEMATIC = 0.04
"""Systematic deviation of a photograph that states none, relative to its concentration [-]."""

LEAST_RANDOM = 0.003
"""Least random deviation that is believed [-]: the resolution of a photograph."""

MEMORY = 0.9
"""Weight of earlier differences beside the newest one, in how wrong predictions are."""

FIRST_ERROR = (1e-6, 1e-4, 1e-6)
"""First guess of the variance that a prediction adds, by `_causes`: a shift by 1 mm, 1 % of the
concentration, and 0.001 everywhere."""

FIRST_WEIGHT = 0.2
"""Weight of that guess beside the first differences."""

RELATED_CELLS = 10.0
"""Neighbouring cells whose random errors are alike."""

SIGNIFICANT = 2.0
"""A concentration counts from so many of its random deviations on: below, noise that cannot fall
under 0 would add up to millilitres over the whole rig."""

NEIGHBOURHOOD = 5
"""Width in cells of the square whose mean must be so large. A mean of noise never is; noise of one
cell in forty is."""

EMPTY_SHARE = 0.1
"""Random deviation of a cell that a first photograph shows empty, relative to its noise."""

FULL_ROUNDS = 3
"""Rounds of spreading a difference of volume: cells at their bounds take no more."""


@dataclass(frozen=True)
class Seen:
    """A photograph's map and its errors, (nz, nx) [-]; NaN in `concentration` where unseen.

    `random` is the deviation that is new in every photograph; `systematic` stays the same.
    """

    concentration: FloatArray
    random: FloatArray
    systematic: FloatArray

    @classmethod
    def of(
        cls,
        concentration: FloatArray,
        deviation: FloatArray | None,
        systematic: FloatArray | None,
    ) -> 'Seen':
        """Return a map (nz, nx) with its total and systematic `deviation`; None, NaN: not known."""
        usual = USUAL_SYSTEMATIC * np.clip(np.nan_to_num(concentration), 0.0, 1.0)
        always = _known(systematic, usual)
        total = _known(deviation, np.hypot(USUAL_RANDOM, always))
        random = np.sqrt(np.maximum(total**2 - always**2, 0.0))
        return cls(concentration, np.maximum(random, LEAST_RANDOM), always)


def _known(values: FloatArray | None, usual: FloatArray) -> FloatArray:
    """Return `values` (nz, nx), the `usual` ones where they are not known."""
    return usual if values is None else np.where(np.isnan(values), usual, values)


@dataclass(frozen=True)
class Estimate:
    """A state: `concentration` and `variance` of its random error, (nz, nx); its `volume`.

    `observed` is the photograph's map without the error of its scale, (nz, nx); NaN where unseen.
    `expected_error` [-] is the relative L2 difference of prediction and `observed` that follows
    from their deviations; NaN without a prediction.
    """

    concentration: FloatArray
    variance: FloatArray
    volume: Volume
    observed: FloatArray
    expected_error: float = math.nan


@dataclass
class StateFilter:
    """Follows the state of the rig from photograph to photograph.

    `pore_volume` (nz, nx) [m^3] belongs to the cells, `spacing` (dz, dx) their size [m].
    """

    pore_volume: FloatArray
    spacing: tuple[float, float]
    _normal: FloatArray = field(init=False)
    _target: FloatArray = field(init=False)
    _error: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self._error = np.array(FIRST_ERROR)
        self._normal = np.zeros((3, 3))
        self._target = np.zeros(3)

    def begin(self, seen: Seen, expected: FloatArray | None = None) -> Estimate:
        """Return the state of the first photograph of a sequence.

        Its unseen cells take the `expected` map (nz, nx), or 0 without one. Cells that do not
        differ from 0 by more than their noise hold no tracer.
        """
        shown_tracer = np.where(
            np.isfinite(seen.concentration) & ~_shows(seen), 0.0, seen.concentration
        )
        state = fill_unseen(shown_tracer, expected)
        variance = np.where(np.isfinite(seen.concentration), seen.random**2, 1.0)
        variance = np.where(shown_tracer == 0.0, (EMPTY_SHARE * seen.random) ** 2, variance)
        volume = Volume.begun(self._balance(seen, state, np.isfinite(seen.concentration)))
        return Estimate(state, variance, volume, seen.concentration)

    def update(
        self,
        last: Estimate,
        predicted: FloatArray,
        seen: Seen,
        injected: float,
        pump_deviation: float = RATE_DEVIATION,
        assumed: float = 1.0,
    ) -> Estimate:
        """Return the state after a photograph.

        Args:
            last: the state that the prediction started from.
            predicted: the prediction for the photograph, (nz, nx) [-].
            seen: the photograph.
            injected: tracer that the pumps were told to inject since `last` [m^3].
            pump_deviation: standard deviation of the rate factor of their pump [-].
            assumed: share of `injected` that the prediction injected [-].
        """
        known = np.isfinite(seen.concentration)
        # where neither shows tracer, noise that cannot fall below 0 must not become tracer
        tells = known & (_shows(seen) | (predicted > SIGNIFICANT * seen.random))
        balance = self._balance(seen, predicted, tells)
        volume = last.volume.updated(
            balance._replace(injected=injected, assumed=assumed, deviation=pump_deviation)
        )
        observed = seen.concentration - volume.scale * seen.systematic
        difference = np.where(known, observed - predicted, 0.0)
        difference = np.where(tells, difference, np.minimum(difference, 0.0))
        causes = self._causes(predicted)
        random = last.variance + seen.random**2
        expected_error = _relative(random + causes @ self._error, observed)
        self._learn(causes, difference, random, tells)
        variance = np.minimum(last.variance + causes @ self._error, 1.0)
        gain = np.where(known, variance / (variance + seen.random**2), 0.0)
        ends = np.clip(np.stack([predicted, predicted + difference]), 0.0, 1.0)
        left = (1.0 - gain) * variance
        uncertain = np.where(known & ~tells, 0.0, left)
        before = self._held(predicted)
        state = self._between(ends, gain, uncertain, before + volume.surplus)
        volume = volume.taken(self._held(state) - before)
        return Estimate(state, left, volume, observed, expected_error)

    def _causes(self, predicted: FloatArray) -> FloatArray:
        """Return the variance of a shift by 1 m, of a factor and of an offset, (nz, nx, 3)."""
        along_z, along_x = np.gradient(predicted, *self.spacing)
        return np.stack([along_z**2 + along_x**2, predicted**2, np.ones(predicted.shape)], axis=-1)

    def _learn(
        self,
        causes: FloatArray,
        difference: FloatArray,
        known_variance: FloatArray,
        known: NDArray[np.bool_],
    ) -> None:
        """Learn how wrong predictions are, by least squares of the squared differences."""
        if not known.any():
            return
        expected = known_variance + causes @ self._error
        most = OUTLIER_DEVIATIONS**2 * expected
        excess = np.minimum(difference**2, most) - known_variance
        weight = np.where(known, 1.0 / expected**2, 0.0)[known]
        rows, values = causes[known], excess[known]
        scale = np.array(FIRST_ERROR)
        rows = rows * scale
        normal = (rows * weight[:, None]).T @ rows
        target = (rows * weight[:, None]).T @ values
        if not self._normal.any():
            self._normal = FIRST_WEIGHT * normal
            self._target = self._normal @ np.ones(3)
        self._normal = MEMORY * self._normal + normal
        self._target = MEMORY * self._target + target
        root = np.linalg.cholesky(self._normal + 1e-9 * np.trace(self._normal) * np.eye(3))
        share, _ = nnls(root.T, np.linalg.solve(root, self._target))
        self._error = scale * share

    def _balance(self, seen: Seen, predicted: FloatArray, counts: NDArray[np.bool_]) -> Balance:
        """Return the volumes of tracer of a photograph and a prediction in the cells that count."""
        pores = np.where(counts, self.pore_volume, 0.0)
        return Balance(
            found=float(np.sum(pores * np.nan_to_num(seen.concentration))),
            predicted=float(np.sum(pores * predicted)),
            unseen=float(np.sum((self.pore_volume - pores) * predicted)),
            shown=float(np.sum(pores * seen.systematic)),
            noise=self._noise(seen),
        )

    def _noise(self, seen: Seen) -> float:
        """Return the variance of the shown volume by random errors [m^6]."""
        known = np.isfinite(seen.concentration)
        return RELATED_CELLS * float(np.sum((self.pore_volume * seen.random)[known] ** 2)) + 1e-18

    def _held(self, state: FloatArray) -> float:
        """Return the volume of tracer in a `state` (nz, nx) [m^3]."""
        return float(np.sum(self.pore_volume * state))

    def _between(
        self, ends: FloatArray, gain: FloatArray, variance: FloatArray, wanted: float
    ) -> FloatArray:
        """Return the state between two `ends`, with a volume between theirs [m^3].

        Args:
            ends: prediction and photograph, (2, nz, nx).
            gain: share of the way from the first to the second, (nz, nx).
            variance: of each cell; uncertain cells change most for the volume, (nz, nx).
            wanted: volume [m^3].
        """
        low, high = ends.min(axis=0), ends.max(axis=0)
        state = np.clip(ends[0] + gain * (ends[1] - ends[0]), low, high)
        little, much = sorted(ends, key=self._held)
        wanted = min(max(wanted, self._held(little)), self._held(much))
        for _ in range(FULL_ROUNDS):
            lacking = wanted - self._held(state)
            free = state < high if lacking > 0.0 else state > low
            weight = np.where(free, variance, 0.0) * self.pore_volume
            total = float(np.sum(weight * self.pore_volume))
            if total <= 0.0:
                break
            state = np.clip(state + lacking / total * weight, low, high)
        lacking = wanted - self._held(state)
        end = much if lacking > 0.0 else little
        room = self._held(end) - self._held(state)
        return state if room == 0.0 else state + lacking / room * (end - state)


def _shows(seen: Seen) -> NDArray[np.bool_]:
    """Return where a photograph shows tracer beyond its noise, (nz, nx)."""
    known = np.isfinite(seen.concentration).astype(float)
    share = np.maximum(uniform_filter(known, NEIGHBOURHOOD), 1.0 / NEIGHBOURHOOD**2)
    mean = uniform_filter(np.nan_to_num(seen.concentration), NEIGHBOURHOOD) / share
    return np.asarray(mean > SIGNIFICANT * seen.random)


def _relative(variance: FloatArray, reference: FloatArray) -> float:
    """Return the root of the sum of `variance` over the L2 norm of `reference`, seen cells only."""
    known = np.isfinite(reference)
    norm = float(np.linalg.norm(reference[known]))
    return math.sqrt(float(np.sum(variance[known]))) / norm if norm > 0.0 else math.nan
