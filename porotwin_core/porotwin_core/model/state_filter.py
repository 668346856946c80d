"""The state estimate: photograph and prediction, weighted in each cell by their errors.

A Kalman filter with one variance for each cell. Its gain is the share of the prediction's error in
the difference between photograph and prediction (Evensen et al., Data Assimilation Fundamentals,
2022, ch. 6). The filter learns the error of predictions from these differences. A second filter
estimates the volume of tracer from pumps, photographs, and the scale of the photographs.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.optimize import nnls

from porotwin_core.geometry.grid import FloatArray, fill_unseen

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

OUTLIER_DEVIATIONS = 4.0
"""A difference counts as at most so many standard deviations: bubbles and reflections are none of
the prediction's errors."""

PUMP_DEVIATION = 0.04
"""Standard deviation of the rate factor of the tracer's pump [-]."""

RELATED_CELLS = 10.0
"""Neighbouring cells whose random errors are alike."""

RESPONSE_DEVIATION = 0.01
"""Error of a shown volume that is no error of scale, relative to it: the bend of the response."""

SIGNIFICANT = 2.0
"""A concentration counts from so many of its random deviations on: below, noise that cannot fall
under 0 would add up to millilitres over the whole rig."""

NEIGHBOURHOOD = 5
"""Width in cells of the square whose mean must be so large. A mean of noise never is; noise of one
cell in forty is."""

EMPTY_SHARE = 0.1
"""Random deviation of a cell that a first photograph shows empty, relative to its noise."""

FULL_ROUNDS = 3
"""Rounds of spreading a difference of volume: cells at 0 and 1 take no more."""


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
        """Return a map (nz, nx) with its total and systematic `deviation`; None: not known."""
        shown = np.clip(np.nan_to_num(concentration), 0.0, 1.0)
        if systematic is None:
            systematic = USUAL_SYSTEMATIC * shown
        total = np.hypot(USUAL_RANDOM, systematic) if deviation is None else deviation
        random = np.sqrt(np.maximum(np.nan_to_num(total) ** 2 - np.nan_to_num(systematic) ** 2, 0))
        return cls(concentration, np.maximum(random, LEAST_RANDOM), np.nan_to_num(systematic))


@dataclass(frozen=True)
class Volume:
    """The estimated volume of tracer.

    `scale` is the error of the photographs, in their systematic deviations; `covariance` (3, 3) is
    that of the volume [m^3], of the scale, and of the factor of the tracer's pump.
    """

    scale: float
    covariance: FloatArray


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
        shown = float(np.sum(self.pore_volume * seen.systematic))
        noise = self._noise(seen)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = [[shown**2 + noise, -shown], [-shown, 1.0]]
        return Estimate(state, variance, Volume(0.0, covariance), seen.concentration)

    def update(
        self,
        last: Estimate,
        predicted: FloatArray,
        seen: Seen,
        injected: float,
        pump_deviation: float = PUMP_DEVIATION,
    ) -> Estimate:
        """Return the state after a photograph.

        Args:
            last: the state that the prediction started from.
            predicted: the prediction for the photograph, (nz, nx) [-].
            seen: the photograph.
            injected: tracer that the pumps injected since `last` [m^3].
            pump_deviation: standard deviation of the rate factor of their pump [-].
        """
        known = np.isfinite(seen.concentration)
        volume, surplus = self._volume(last.volume, predicted, seen, injected, pump_deviation)
        observed = seen.concentration - volume.scale * seen.systematic
        difference = np.where(known, observed - predicted, 0.0)
        # where neither shows tracer, noise that cannot fall below 0 must not become tracer
        tells = known & (_shows(seen) | (predicted > SIGNIFICANT * seen.random))
        difference = np.where(tells, difference, np.minimum(difference, 0.0))
        causes = self._causes(predicted)
        random = last.variance + seen.random**2
        expected_error = _relative(random + causes @ self._error, observed)
        self._learn(causes, difference, random, tells)
        variance = np.minimum(last.variance + causes @ self._error, 1.0)
        gain = np.where(known, variance / (variance + seen.random**2), 0.0)
        state = np.clip(predicted + gain * difference, 0.0, 1.0)
        left = (1.0 - gain) * variance
        wanted = float(np.sum(self.pore_volume * predicted)) + surplus
        state = self._with_volume(state, np.where(known & ~tells, 0.0, left), wanted)
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

    def _volume(
        self,
        last: Volume,
        predicted: FloatArray,
        seen: Seen,
        injected: float,
        pump_deviation: float,
    ) -> tuple[Volume, float]:
        """Return what is known of the volume, and what the prediction lacks of it [m^3].

        The factor of the pump stays as doubtful as it is told to be (`pump_deviation`), because
        others learn it; its error is the same all the time (a consider filter; Schmidt, 1966).
        """
        known = np.isfinite(seen.concentration)
        counts = known & (_shows(seen) | (predicted > SIGNIFICANT * seen.random))
        pores = np.where(counts, self.pore_volume, 0.0)
        shown = float(np.sum(pores * seen.systematic))
        found = float(np.sum(pores * np.nan_to_num(seen.concentration)))
        covariance = _with_pump(last.covariance, pump_deviation)
        step = np.eye(3)
        step[0, 2] = injected
        covariance = step @ covariance @ step.T
        looks_at = np.array([1.0, shown, 0.0])
        noise = self._noise(seen) + (RESPONSE_DEVIATION * found) ** 2
        gain = covariance @ looks_at / (looks_at @ covariance @ looks_at + noise)
        gain[2] = 0.0
        difference = found - float(np.sum(pores * predicted)) - shown * last.scale
        moved = gain * difference
        left = np.eye(3) - np.outer(gain, looks_at)
        covariance = left @ covariance @ left.T + noise * np.outer(gain, gain)
        return Volume(last.scale + float(moved[1]), covariance), float(moved[0])

    def _noise(self, seen: Seen) -> float:
        """Return the variance of the shown volume by random errors [m^6]."""
        known = np.isfinite(seen.concentration)
        return RELATED_CELLS * float(np.sum((self.pore_volume * seen.random)[known] ** 2)) + 1e-18

    def _with_volume(self, state: FloatArray, variance: FloatArray, wanted: float) -> FloatArray:
        """Return `state` with the `wanted` volume [m^3]; uncertain cells change most."""
        for _ in range(FULL_ROUNDS):
            lacking = wanted - float(np.sum(self.pore_volume * state))
            free = state < 1.0 if lacking > 0.0 else state > 0.0
            weight = np.where(free, variance, 0.0) * self.pore_volume
            total = float(np.sum(weight * self.pore_volume))
            if total <= 0.0:
                break
            state = np.clip(state + lacking / total * weight, 0.0, 1.0)
        return state


def _with_pump(covariance: FloatArray, deviation: float) -> FloatArray:
    """Return the `covariance` of a volume (3, 3) with another `deviation` of the pump's factor."""
    before = math.sqrt(covariance[2, 2])
    if before == 0.0:
        changed = covariance.copy()
        changed[2, 2] = deviation**2
        return changed
    factor = np.array([1.0, 1.0, deviation / before])
    return covariance * np.outer(factor, factor)


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
