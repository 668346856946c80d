"""What a recording says, made ready for comparison: chosen frames, smoothed, weighed by its noise.

A residual is compared after smoothing over `WIDTH` cells. This leaves what a displaced front shows
and suppresses grain, edge blur and the little that a scheme smears, all of which change sign across
a front. It is divided by its standard deviation: that of the smoothed noise, of the clipped and
quantised background, and a share of a cell by which no front is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig import Rig
from porotwin_core.wells import Schedule
from porotwin_diagnosis.data.noise import Noise, blur, measure_noise
from porotwin_recording.recording import Recording

WIDTH = 1.5
"""Width [cells] over which residuals are smoothed before they are compared."""

COARSE_WIDTH = 4.0
"""The same for the first steps of a fit, whose fronts may still lie cells apart."""

STRIDE = 2
"""Of the smoothed residual, every so many cells are kept each way."""

HELD_OUT_SHARE = 0.3
"""The last part of the recording, which no fit sees (diagnosis contract)."""

FRONT_TOLERANCE = 0.12
"""By how much of a cell a front may lie elsewhere without meaning anything."""

BACKGROUND_TOLERANCE = 0.004
"""What quantisation and clipping leave unsure of a smoothed tracer-free map."""

ACTIVE, FULL = 0.03, 0.9
"""Smoothed map above which a cell holds tracer; above which it holds nothing but stock."""

TRACER, FILLED_SHARE = 0.3, 0.02
"""A first map with more than this share of cells above this concentration holds tracer."""

FITTED_FRAMES, HELD_OUT_FRAMES = 20, 12
FEWEST_FRAMES = 8


@dataclass(frozen=True)
class Sample:
    """One recording as the fits see it.

    `times` [s] and `observed` (nt, nz, nx) hold the chosen frames, those to be fitted first;
    `fitted` counts them. `held_out_start` [s] is where the held-out part begins. `initial`
    (nz, nx) is the first map, where that holds tracer which no pump has brought.
    """

    rig: Rig
    schedule: Schedule
    grid: Grid
    times: NDArray[np.float64]
    observed: FloatArray
    fitted: int
    noise: Noise
    start: float
    held_out_start: float
    end: float
    initial: FloatArray | None = None
    weights: dict[float, FloatArray] = field(default_factory=dict, compare=False, repr=False)

    @property
    def model_start(self) -> float:
        """When the model begins [s]: with the experiment, or with the first map if that is where it
        begins."""
        return 0.0 if self.initial is None else self.start

    def initial_on(self, grid: Grid) -> FloatArray | None:
        """Return the map from which the model begins on `grid`; None for water."""
        return None if self.initial is None else conservative_resample(self.initial, grid.shape)

    @cached_property
    def known(self) -> FloatArray:
        """1 where the image says something, else 0; (nt, nz, nx)."""
        return np.isfinite(self.observed).astype(float)

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return self.end - self.start

    @cached_property
    def filled(self) -> FloatArray:
        """The observed maps with zeros where the image says nothing."""
        return np.where(self.known > 0, self.observed, 0.0)

    def weight(self, width: float) -> FloatArray:
        """Return one over the standard deviation of a smoothed residual, (nt, nz', nx')."""
        if width not in self.weights:
            self.weights[width] = self._weight(width)
        return self.weights[width]

    def _weight(self, width: float) -> FloatArray:
        c = self._smoothed(width)
        slope = np.hypot(np.gradient(c, axis=1), np.gradient(c, axis=2))
        square = self._noise(width) ** 2 + (FRONT_TOLERANCE * slope) ** 2
        square += BACKGROUND_TOLERANCE**2
        half_known = np.stack([gaussian_filter(frame, width) for frame in self.known]) > 0.5
        return (half_known / np.sqrt(square))[:, ::STRIDE, ::STRIDE]

    def _smoothed(self, width: float) -> FloatArray:
        return np.stack([gaussian_filter(frame, width) for frame in self.filled])

    def _noise(self, width: float) -> FloatArray:
        """Return the deviation of the noise that smoothing leaves, (nt, nz, nx)."""
        grain = self.noise.correlation
        damping = grain / np.hypot(grain, width)
        return self.noise.clipped_deviation(self._smoothed(width)) * damping

    @cached_property
    def compared(self) -> FloatArray:
        """The smoothed observed map where residuals are compared, (nt, nz', nx')."""
        return self._smoothed(WIDTH)[:, ::STRIDE, ::STRIDE]

    @cached_property
    def active(self) -> int:
        """How many compared cells hold tracer."""
        return int(np.count_nonzero(self.compared > ACTIVE))

    @cached_property
    def front(self) -> NDArray[np.bool_]:
        """Compared cells that hold some tracer but not all stock, where a gap shows."""
        seen = self.weight(WIDTH) > 0
        return (self.compared > ACTIVE) & (self.compared < FULL) & seen

    @cached_property
    def at_most(self) -> FloatArray:
        """What the compared cells may hold for all that noise tells, (nt, nz', nx')."""
        return self.compared + 2.0 * self._noise(WIDTH)[:, ::STRIDE, ::STRIDE]

    @cached_property
    def expected_squares(self) -> FloatArray:
        """The squares of whitened residuals that noise alone leads one to expect, (nt, nz', nx')"""
        return (self._noise(WIDTH)[:, ::STRIDE, ::STRIDE] * self.weight(WIDTH)) ** 2

    def whitened(
        self, predicted: FloatArray, *, width: float = WIDTH, soft: float = 0.0
    ) -> FloatArray:
        """Return the weighed residual observed - predicted, (nt, nz', nx').

        `predicted` (nt, nz, nx) is what the camera would show without noise; `soft` the blur
        [cells] that it lacks beside the recorded maps. It may hold the first frames only.
        """
        expected = self.noise.expected(blur(np.clip(predicted, 0.0, 1.0), soft))
        count = len(expected)
        residual = (self.filled[:count] - expected) * self.known[:count]
        smooth = gaussian_filter(residual, (0.0, width, width))[:, ::STRIDE, ::STRIDE]
        return smooth * self.weight(width)[:count]

    def relative_error(self, predicted: FloatArray, *, held_out: bool = True) -> float:
        """Return the relative L2 error of `predicted` over the held-out (or fitted) frames."""
        part = slice(self.fitted, None) if held_out else slice(None, self.fitted)
        known = self.known[part] > 0
        observed = self.observed[part][known]
        norm = max(float(np.linalg.norm(observed)), 1e-12)
        return float(np.linalg.norm(predicted[part][known] - observed)) / norm


def read_sample(recording: Recording) -> Sample:
    """Return the frames of `recording` that a diagnosis compares.

    Raises:
        InputError: too few frames, or no tracer in them, to judge anything.
    """
    times, maps = recording.times, recording.concentration
    held_out = times[0] + (1.0 - HELD_OUT_SHARE) * (times[-1] - times[0])
    before = np.flatnonzero((times < held_out) & (times > times[0]))
    after = np.flatnonzero(times >= held_out)
    if len(times) < FEWEST_FRAMES:
        raise InputError(
            f'{recording.source}: {len(times)} maps are too few to judge a model; '
            f'record at least {FEWEST_FRAMES}'
        )
    seen = np.array([bool(np.any(frame > 0.1)) for frame in maps])
    with_tracer = before[seen[before]]
    if not with_tracer.size or not seen[after].any():
        raise InputError(
            f'{recording.source}: shows no tracer in its first 70 % or its last 30 %; '
            'record while tracer is in the rig'
        )
    chosen = np.concatenate([_spread(with_tracer, FITTED_FRAMES), _spread(after, HELD_OUT_FRAMES)])
    return Sample(
        rig=recording.rig,
        schedule=recording.delivered,
        grid=recording.grid,
        times=times[chosen],
        observed=maps[chosen].astype(float),
        fitted=min(len(with_tracer), FITTED_FRAMES),
        noise=measure_noise(maps[:: max(1, len(times) // 40)]),
        start=float(times[0]),
        held_out_start=float(held_out),
        end=float(times[-1]),
        initial=_initial(recording),
    )


def _initial(recording: Recording) -> FloatArray | None:
    """Return the first map if it holds tracer before anything was pumped, which is then where the
    model begins; None for a rig that begins with water, or whose pumps ran before the first map.

    Also where tracer is injected from that moment on: a late clock shows the same, and competes.
    """
    start, first = recording.times[0], recording.concentration[0]
    rows = recording.delivered.rows
    pumped = any(row.rate.rate and row.time < start for row in rows)
    injects = any(row.rate.rate * row.rate.concentration > 0 and row.time <= start for row in rows)
    if pumped or injects or share_with_tracer(first) < FILLED_SHARE:
        return None
    return filled_map(first, recording.grid)


def share_with_tracer(concentration: FloatArray) -> float:
    """Return the share of cells (nz, nx) that hold tracer, to be compared with `FILLED_SHARE`."""
    return float(np.mean(concentration > TRACER))


def filled_map(frame: FloatArray, grid: Grid) -> FloatArray:
    """Return `frame` (nz, nx) on `grid`, 0 to 1, holes filled from what is seen around them."""
    known = np.isfinite(frame)
    if not known.all():
        weight = gaussian_filter(known.astype(float), 3.0)
        guess = gaussian_filter(np.where(known, frame, 0.0), 3.0) / np.maximum(weight, 1e-6)
        frame = np.where(known, frame, guess)
    return np.clip(conservative_resample(frame.astype(float), grid.shape), 0.0, 1.0)


def coarsened(sample: Sample, factor: int) -> Sample:
    """Return `sample` averaged over cells `factor` times larger each way: cheap, for screening."""
    grid = sample.rig.grid(
        max(1, round(sample.grid.nx / factor)), max(1, round(sample.grid.nz / factor))
    )
    observed = np.stack([conservative_resample(frame, grid.shape) for frame in sample.observed])
    noise = sample.noise
    return replace(
        sample,
        grid=grid,
        observed=observed,
        noise=replace(noise, correlation=max(0.5, noise.correlation / factor)),
        weights={},
    )


def _spread(indices: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return at most `count` of `indices`, evenly spread, the last one among them."""
    if len(indices) <= count:
        return indices
    return indices[np.round(np.linspace(0, len(indices) - 1, count)).astype(int)]


def misfit(samples: Sequence[Sample], residuals: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the root mean square of whitened residuals at fronts: fitted, held out.

    What counts are cells that hold some tracer but not all stock, as predicted, or as observed
    beyond noise: of a pale plume's interior the noise would choose the low ones alone. The observed
    ones divide, so that neither an empty nor a full rig dilutes a gap.
    """
    squares = [
        residual**2 * _counted(sample, residual)
        for sample, residual in zip(samples, residuals, strict=True)
    ]
    return _root_mean(samples, squares)


def noise_misfit(samples: Sequence[Sample], residuals: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the misfit that the noise alone leads one to expect of a model that leaves
    `residuals`, in the cells that count: fitted, held out."""
    squares = [
        sample.expected_squares * _counted(sample, residual)
        for sample, residual in zip(samples, residuals, strict=True)
    ]
    return _root_mean(samples, squares)


def _counted(sample: Sample, residual: FloatArray) -> NDArray[np.bool_]:
    weight = sample.weight(WIDTH)
    predicted = sample.compared - residual / np.where(weight > 0, weight, np.inf)
    most = np.maximum(sample.compared, predicted)
    least = np.minimum(sample.at_most, predicted)
    return (most > ACTIVE) & (least < FULL)


def _root_mean(samples: Sequence[Sample], squares: Sequence[FloatArray]) -> tuple[float, float]:
    sums, counts = np.zeros(2), np.zeros(2)
    for sample, square in zip(samples, squares, strict=True):
        for index, part in enumerate((slice(None, sample.fitted), slice(sample.fitted, None))):
            sums[index] += float(square[part].sum())
            counts[index] += np.count_nonzero(sample.front[part])
    fitted, held_out = np.sqrt(sums / np.maximum(counts, 1))
    return float(fitted), float(held_out)
