"""The frames of a recording that fits compare with the model, and the whitened residual.

The residual between an observed map o and a predicted concentration c is smoothed and divided by
its standard deviation:

    r = C^(-1/2) S(o - E[o | c]) / sigma,
    sigma^2 = (damping s)^2 + (FRONT_TOLERANCE |grad S(o)|)^2 + PACKED_STEP^2.

S is a Gaussian of `SMOOTHING_WIDTH` cells. It keeps a displaced front and suppresses grain, point
spread and numerical smearing, which change sign across a front. E[o | c] is the mean of a noisy map
of c (`Noise.expected`). s is the standard deviation of the noise; smoothing damps it by
w / hypot(w, SMOOTHING_WIDTH) for noise of the width w. The gradient term is the uncertainty of the
position of a front.

Maps from photographs carry deviations. Their random deviation bounds s from below in each cell.
Their systematic deviation comes from a few errors that all maps share, with the covariance C
(`shared_errors`). Without delivered deviations C is the identity.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from porotwin_checks.start import Start
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.model.gauge_reading import GaugeReading
from porotwin_core.model.held_out_share import held_out_begin
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.initial_tracer import start_and_tracer
from porotwin_diagnosis.data.noise import SMOOTHING_WIDTH, TRACER_PRESENT, Noise, blurred
from porotwin_diagnosis.data.noise_estimation import add_delivered, measure_noise
from porotwin_diagnosis.data.observed_maps import evenly_spread
from porotwin_diagnosis.data.shared_errors import (
    LOCAL_SHARE,
    ErrorSizes,
    SharedErrors,
    error_modes,
    measured_errors,
    nearest_level,
    sands_of,
)
from porotwin_diagnosis.thresholds import SYSTEMATIC_MISFIT
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import PACKED_STEP

COARSE_SMOOTHING_WIDTH = 4.0
"""Width [cells] of the smoothing in the first steps of a fit, where fronts may lie cells apart."""

STRIDE = 2
"""Every second cell of a smoothed residual is kept each way; the others repeat their neighbours."""

FRONT_TOLERANCE = 0.12
"""Standard deviation [cells] of the position of a front that any numerical scheme leaves."""

STATED_SHARE = 0.5
"""Share of a delivered random deviation that is expected in smoothed maps. It is the deviation of
single cells, and smoothing damps changes from cell to cell. On eleven recordings from
photographs with known truth, the true maps leave 0.17 to 0.65 of it, 0.45 in the mean."""

FULL_STOCK = 0.9
"""Smoothed concentration [-] above which a cell holds stock only and cannot show a gap."""

FITTED_FRAMES, HELD_OUT_FRAMES = 20, 12
"""Largest number of frames for fits and for the held-out part; they bound time and memory."""

FEWEST_FRAMES = 8
"""Fewest frames of a recording that can be diagnosed."""

FEWEST_CELLS = 4
"""Fewest columns and rows of the maps: slopes and blur need neighbours on both sides."""

NOISE_FRAMES = 40
"""About so many frames are used to estimate the noise. All frames share the grain, so that more of
them would add little."""


@dataclass(frozen=True)
class Sample:
    """The frames of one recording that are compared with the model.

    Attributes:
        rig: nominal description of the rig.
        schedule: rates of the wells over time.
        grid: grid of the maps.
        times: times of the frames [s], (nt,); the fitted frames first, then the held-out ones.
        observed: observed concentration [-], (nt, nz, nx); NaN at the rim and where nothing is
            seen.
        fitted_frames: number of frames that fits use.
        noise: noise of the maps.
        start: time of the first map of the recording [s].
        held_out_start: beginning of the held-out part [s].
        end: time of the last map of the recording [s].
        initial: first map (nz, nx) [-] if it holds tracer from before the recording; else None.
        may_have_held_tracer: whether `initial` is None because a late clock is believed, although
            tracer from before the recording explains the first map as well.
        own_deviation: delivered standard deviation [-] of each value by itself, (nt, nz, nx); None
            where the recording has none.
        shared_errors: delivered standard deviations of the errors that all maps share, or None.
        rate_modes: change of the maps [-] by one deviation of each unknown rate, (k, nt, nz, nx);
            None if all rates are known.
        least_scale: least map value [-] of undiluted stock, where the scale of the maps is open: 1
            for maps whose core counts as 1. No map shows more. Predictions take the scale that
            suits the fitted frames best, below the core. None if the scale is known.
        readings: readings of the outflow and of pressures; they count for the fitted and for the
            held-out part.
    """

    rig: Rig
    schedule: Schedule
    grid: Grid
    times: NDArray[np.float64]
    observed: FloatArray
    fitted_frames: int
    noise: Noise
    start: float
    held_out_start: float
    end: float
    initial: FloatArray | None = None
    may_have_held_tracer: bool = False
    own_deviation: FloatArray | None = None
    shared_errors: ErrorSizes | None = None
    rate_modes: FloatArray | None = None
    least_scale: float | None = None
    readings: tuple[GaugeReading, ...] = ()

    @property
    def model_start(self) -> float:
        """Start time of the model [s]: the time of `initial` if there is one, else zero."""
        return 0.0 if self.initial is None else self.start

    def initial_on(self, grid: Grid) -> FloatArray | None:
        """Return `initial` on `grid`, (nz, nx) [-]; None if the rig starts without tracer."""
        return None if self.initial is None else conservative_resample(self.initial, grid.shape)

    @property
    def duration(self) -> float:
        """Duration of the recording [s]."""
        return self.end - self.start

    @cached_property
    def seen_mask(self) -> FloatArray:
        """1 where a cell is seen, else 0; (nt, nz, nx)."""
        return np.isfinite(self.observed).astype(float)

    @cached_property
    def observed_or_zero(self) -> FloatArray:
        """The observed maps [-] with zero in unseen cells, (nt, nz, nx)."""
        return np.where(self.seen_mask > 0, self.observed, 0.0)

    @cached_property
    def smoothed_observed(self) -> FloatArray:
        """The smoothed observed maps [-] at the compared cells, (nt, nz', nx')."""
        return self._smoothed(SMOOTHING_WIDTH)[:, ::STRIDE, ::STRIDE]

    @cached_property
    def upper_limit(self) -> FloatArray:
        """The smoothed observed maps plus two standard deviations of noise [-], (nt, nz', nx')."""
        deviation = self._noise_deviation(SMOOTHING_WIDTH)[:, ::STRIDE, ::STRIDE]
        return self.smoothed_observed + 2.0 * deviation

    @cached_property
    def tracer_cells(self) -> int:
        """Number of compared cells with tracer, over all frames."""
        return int(np.count_nonzero(self.smoothed_observed > TRACER_PRESENT))

    @cached_property
    def front_mask(self) -> NDArray[np.bool_]:
        """True at compared cells with tracer below full stock, where gaps show; (nt, nz', nx')."""
        seen = self.weight(SMOOTHING_WIDTH) > 0
        smoothed = self.smoothed_observed
        return (smoothed > TRACER_PRESENT) & (smoothed < FULL_STOCK) & seen

    @cached_property
    def expected_noise_squares(self) -> FloatArray:
        """Expected squares of whitened residuals that come from noise alone, (nt, nz', nx').

        `STATED_SHARE` of the noise that imaging states counts, or the measured noise if it is more.
        """
        deviation = self._noise_deviation(SMOOTHING_WIDTH, STATED_SHARE)[:, ::STRIDE, ::STRIDE]
        return (deviation * self.weight(SMOOTHING_WIDTH)) ** 2

    @cached_property
    def expected_shared_square(self) -> float:
        """Expected squared misfit [-] from errors that all maps share; 0 without any."""
        shared = self._shared(SMOOTHING_WIDTH, len(self.times))
        return 0.0 if shared is None else SYSTEMATIC_MISFIT**2 * shared.effective_number

    def weight(self, width: float) -> FloatArray:
        """Return 1 / sigma of residuals smoothed over `width` [cells], (nt, nz', nx').

        The weight is zero where less than half of the surroundings is seen.
        """
        if width not in self._weights:
            self._weights[width] = self._computed_weight(width)
        return self._weights[width]

    @cached_property
    def _weights(self) -> dict[float, FloatArray]:
        """Weights that were computed already, by smoothing width."""
        return {}

    def _computed_weight(self, width: float) -> FloatArray:
        smoothed = self._smoothed(width)
        slope = np.hypot(np.gradient(smoothed, axis=1), np.gradient(smoothed, axis=2))
        square = self._noise_deviation(width) ** 2 + (FRONT_TOLERANCE * slope) ** 2
        square += PACKED_STEP**2
        half_seen = np.stack([gaussian_filter(frame, width) for frame in self.seen_mask]) > 0.5
        return (half_seen / np.sqrt(square))[:, ::STRIDE, ::STRIDE]

    def _smoothed(self, width: float) -> FloatArray:
        return np.stack([gaussian_filter(frame, width) for frame in self.observed_or_zero])

    def _noise_deviation(self, width: float, stated_share: float = 1.0) -> FloatArray:
        """Return the standard deviation of noise smoothed over `width` [cells], (nt, nz, nx).

        `stated_share` is the share of a delivered deviation that counts.
        """
        measured = self._measured_deviation(width)
        if self.own_deviation is None:
            return self.noise.with_delivered(measured, self._smoothed(width))
        own = gaussian_filter(self.own_deviation**2, (0.0, width, width))
        return np.maximum(measured, stated_share * np.sqrt(own))

    def _measured_deviation(self, width: float) -> FloatArray:
        """Return that standard deviation without the stated one, (nt, nz, nx)."""
        grain = self.noise.correlation
        damping = grain / np.hypot(grain, width)
        return self.noise.clipped_deviation(self._smoothed(width)) * damping

    def whitened(
        self,
        predicted: FloatArray,
        *,
        width: float = SMOOTHING_WIDTH,
        point_spread_width: float = 0.0,
    ) -> FloatArray:
        """Return the whitened residual r [-], (nt, nz', nx'); see the module for the formula.

        Args:
            predicted: noise-free maps (nt, nz, nx) [-] of all frames or of the first ones.
            width: width [cells] of the smoothing S.
            point_spread_width: width [cells] of the point spread that `predicted` lacks.
        """
        return self.decorrelated(
            self.unshared_residual(predicted, width=width, point_spread_width=point_spread_width),
            width,
        )

    def unshared_residual(
        self,
        predicted: FloatArray,
        *,
        width: float = SMOOTHING_WIDTH,
        point_spread_width: float = 0.0,
    ) -> FloatArray:
        """Return the whitened residual [-] if the errors that all maps share were zero.

        The arguments have the meaning of `whitened`.
        """
        shown = np.clip(self.at_scale(predicted), 0.0, self.least_scale or 1.0)
        expected = self.noise.expected(blurred(shown, point_spread_width))
        count = len(expected)
        residual = (self.observed_or_zero[:count] - expected) * self.seen_mask[:count]
        return np.asarray(at_compared_cells(residual, width) * self.weight(width)[:count])

    def weighted(self, smooth: FloatArray) -> FloatArray:
        """Return a `smooth` change [-] at the compared cells as a whitened residual.

        Both are (nt, nz', nx'), for all frames or for the first ones.
        """
        return self.decorrelated(smooth * self.weight(SMOOTHING_WIDTH)[: len(smooth)])

    def camera_change(self, predicted: FloatArray, point_spread_width: float) -> FloatArray:
        """Return the change (nt, nz, nx) [-] of maps by the most probable shared errors.

        They are those that bring the maps `predicted` (nt, nz, nx) nearest to the observed ones, at
        their own cost. `point_spread_width` [cells] is that of `whitened`.
        """
        shared = self._shared(SMOOTHING_WIDTH, len(predicted))
        if self.shared_errors is None or shared is None:
            return np.zeros_like(predicted)
        residual = self.unshared_residual(predicted, point_spread_width=point_spread_width)
        return np.tensordot(shared.most_probable(residual), self._modes(len(predicted)), axes=1)

    def decorrelated(self, residual: FloatArray, width: float = SMOOTHING_WIDTH) -> FloatArray:
        """Return a whitened `residual` without the errors that all maps share, C^(-1/2) r."""
        shared = self._shared(width, len(residual))
        return residual if shared is None else shared.decorrelated(residual)

    def _shared(self, width: float, count: int) -> SharedErrors | None:
        """Return the shared errors of the first `count` frames, for residuals of `width`."""
        if self.shared_errors is None and self.rate_modes is None:
            return None
        if (width, count) not in self._decorrelations:
            modes = self._modes(count)
            smooth = gaussian_filter(modes, (0.0, 0.0, width, width))[..., ::STRIDE, ::STRIDE]
            cost = SYSTEMATIC_MISFIT**2 * max(1, int(np.count_nonzero(self.front_mask[:count])))
            white = (smooth * self.weight(width)[:count]).astype(np.float32)
            self._decorrelations[width, count] = SharedErrors(white, cost)
        return self._decorrelations[width, count]

    def _modes(self, count: int) -> FloatArray:
        """Return the modes (k, count, nz, nx) [-] of the shared errors, of the first frames."""
        modes = [] if self.rate_modes is None else [self.rate_modes[:, :count]]
        if self.shared_errors is not None:
            sands, maps = sands_of(self.rig, self.grid), self.observed_or_zero[:count]
            modes.append(error_modes(self.shared_errors, maps, sands, self.grid))
        return np.concatenate(modes) * self.seen_mask[:count]

    @cached_property
    def _decorrelations(self) -> dict[tuple[float, int], SharedErrors]:
        """Shared errors that were prepared already, by smoothing width and number of frames."""
        return {}

    def relative_error(self, predicted: FloatArray, *, held_out: bool = True) -> float:
        """Return the relative L2 error [-] of `predicted` (nt, nz, nx) over the seen cells.

        It covers the held-out frames, or the fitted ones with `held_out=False`.
        """
        part = slice(self.fitted_frames, None) if held_out else slice(None, self.fitted_frames)
        predicted, seen = self.at_scale(predicted), self.seen_mask[part] > 0
        observed = self.observed[part][seen]
        norm = max(float(np.linalg.norm(observed)), 1e-12)
        return float(np.linalg.norm(predicted[part][seen] - observed)) / norm

    def at_scale(self, predicted: FloatArray) -> FloatArray:
        """Return `predicted` (nt, nz, nx) on the scale of the maps."""
        if self.least_scale is None:
            return predicted
        part = slice(None, self.fitted_frames or len(self.times))
        below = np.where(self.observed < FULL_STOCK * self.least_scale, self.observed, np.nan)
        return predicted * max(nearest_level(predicted[part], below[part]), self.least_scale)


def at_compared_cells(maps: FloatArray, width: float) -> FloatArray:
    """Return `maps` (nt, nz, nx) smoothed over `width` [cells], at the compared cells only.

    Rows that are not compared are left out before the second pass of the filter.
    """
    rows = gaussian_filter1d(maps, width, axis=1)[:, ::STRIDE]
    return np.asarray(gaussian_filter1d(rows, width, axis=2)[..., ::STRIDE])


def read_sample(recording: Recording) -> Sample:
    """Return the frames of `recording` for the comparison with the model.

    Raises:
        InputError: too few frames, or no tracer in the fitted or in the held-out part.
    """
    times, maps = recording.times, recording.maps
    assert maps is not None  # `times` says so otherwise
    held_out = held_out_begin(times[0], times[-1])
    before = np.flatnonzero((times < held_out) & (times > times[0]))
    after = np.flatnonzero(times >= held_out)
    if len(times) < FEWEST_FRAMES:
        raise InputError(
            f'{recording.source}: {len(times)} maps are too few to judge a model; '
            f'record at least {FEWEST_FRAMES}'
        )
    if min(recording.grid.shape) < FEWEST_CELLS:
        rows, columns = recording.grid.shape
        raise InputError(
            f'{recording.source}: maps of {columns} x {rows} cells are too coarse to judge a '
            f'model; make at least {FEWEST_CELLS} columns and rows'
        )
    with_tracer = np.array([bool(np.any(frame > PLUME_THRESHOLD)) for frame in maps])
    fitted = before[with_tracer[before]]
    if not fitted.size or not with_tracer[after].any():
        raise InputError(
            f'{recording.source}: shows no tracer in its first 70 % or its last 30 %; '
            'record while tracer is in the rig'
        )
    chosen = np.concatenate(
        [evenly_spread(fitted, FITTED_FRAMES), evenly_spread(after, HELD_OUT_FRAMES)]
    )
    own, shared = _delivered(recording, chosen)
    start, initial = start_and_tracer(recording)
    return Sample(
        rig=recording.rig,
        schedule=recording.delivered,
        grid=recording.grid,
        times=times[chosen],
        observed=_without_rim(np.stack([maps[int(index)] for index in chosen]).astype(float)),
        fitted_frames=min(len(fitted), FITTED_FRAMES),
        noise=_noise(recording, max(1, len(times) // NOISE_FRAMES)),
        start=float(times[0]),
        held_out_start=float(held_out),
        end=float(times[-1]),
        initial=initial,
        may_have_held_tracer=start is Start.LATE_OR_USED,
        own_deviation=own,
        shared_errors=shared,
        least_scale=1.0 if maps.origin.scale else None,
        readings=recording.readings,
    )


def _without_rim(maps: FloatArray) -> FloatArray:
    """Return `maps` (nt, nz, nx) with NaN in the outermost cells.

    The camera's blur mixes the rim with the unknown frame of the rig. At the rim, a plume that lay
    flat on the bottom left nearly as much as the true effect may leave everywhere.
    """
    inside = np.full_like(maps, np.nan)
    inside[:, 1:-1, 1:-1] = maps[:, 1:-1, 1:-1]
    return inside


def _delivered(
    recording: Recording, chosen: NDArray[np.intp]
) -> tuple[FloatArray | None, ErrorSizes | None]:
    """Return the errors of the `chosen` maps as `recording` states them.

    Returns:
        The deviation of each value by itself, (nt, nz, nx) [-], and the sizes of the errors that
        all maps share; None each where the recording says nothing.
    """
    stored = recording.maps
    if stored is None or stored.deviation is None or stored.systematic is None:
        return None, None
    maps, deviation, systematic = (
        np.stack([series[int(index)] for index in chosen]).astype(float)
        for series in (stored, stored.deviation, stored.systematic)
    )
    sands = sands_of(recording.rig, recording.grid)
    sizes = measured_errors(maps, systematic, sands, recording.grid)
    random = np.maximum(deviation**2 - systematic**2, 0.0)
    own = np.sqrt(random + (LOCAL_SHARE * systematic) ** 2)
    sizes = replace(sizes, scales=()) if stored.origin.scale else sizes  # taken by predictions
    return np.where(np.isfinite(own), own, 0.0), sizes


def _noise(recording: Recording, step: int) -> Noise:
    """Return the noise of every `step`-th map, with the errors that the recording states."""
    stored = recording.maps
    assert stored is not None
    maps = stored[::step]
    noise = measure_noise(maps)
    if stored.deviation is None or stored.systematic is None:
        return noise
    return add_delivered(noise, maps, stored.deviation[::step], stored.systematic[::step])


LEAST_COARSE_CORRELATION = 0.5
"""Least width [coarse cells] of averaged noise: it fluctuates from cell to cell at most."""


def coarsened(sample: Sample, factor: int) -> Sample:
    """Return `sample` averaged over cells that are `factor` times larger each way.

    The standard deviations of the noise stay unchanged, which is conservative.
    """
    grid = sample.rig.grid(
        max(1, round(sample.grid.nx / factor)), max(1, round(sample.grid.nz / factor))
    )
    observed = np.stack([conservative_resample(frame, grid.shape) for frame in sample.observed])
    correlation = max(LEAST_COARSE_CORRELATION, sample.noise.correlation / factor)
    noise = replace(sample.noise, correlation=correlation)
    own, modes = sample.own_deviation, sample.rate_modes
    return replace(
        sample,
        grid=grid,
        observed=observed,
        noise=noise,
        own_deviation=None
        if own is None
        else np.stack([conservative_resample(frame, grid.shape) for frame in own]),
        rate_modes=None
        if modes is None
        else np.array([[conservative_resample(frame, grid.shape) for frame in m] for m in modes]),
    )
