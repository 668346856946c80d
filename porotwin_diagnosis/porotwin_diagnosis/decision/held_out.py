"""The held-out part of a recording: errors before and after, and how much of the gap closes.

Before: the model as it is configured. After: the model with the effects that were kept. Errors are
relative L2 norms over the last 30 % of a recording, which no fit has seen.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace

import numpy as np

from porotwin_core.geometry.grid import FloatArray, relative_error
from porotwin_diagnosis.data.error_parts import COARSER, ErrorParts, error_parts, held_out_frames
from porotwin_diagnosis.data.noise import Noise, blurred, noise_floor
from porotwin_diagnosis.data.noise_estimation import measure_point_spread_width
from porotwin_diagnosis.data.observed_maps import evenly_spread
from porotwin_diagnosis.data.sample import Sample, coarsened
from porotwin_diagnosis.data.shared_errors import best_level
from porotwin_diagnosis.decision.numerics import ACCURATE, Numerics, before_and_after
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.forward import Forward
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.model.presets import preset_named

LEAST_GAP = 1e-4
"""Error above the noise floor below which there is no gap to close: 0.01 %, far less than any
recording shows."""

MOST_MAPS = 240
"""Most maps in memory, evenly spread: the last 30 % of 27 hours are 1000 maps, and each counts
three times, as observed and predicted."""

TIME_BLOCKS, TILES = 6, (4, 6)
"""Blocks of frames, and tiles of the map (rows, columns), for the bootstrap: errors last for
minutes and extend over centimetres, so that only parts as large as these are independent."""

DRAWS = 400
"""Bootstrap draws: enough that 20 of them lie beyond each end of a 90 % interval."""

INTERVAL_PERCENTILES = (5.0, 95.0)
"""Percentiles of the draws that bound a 90 % interval."""


@dataclass(frozen=True)
class HeldOut:
    """The held-out part of one recording: its frames, observed and predicted.

    Attributes:
        times: times of the frames [s], (nt,).
        observed: observed maps [-], (nt, nz, nx), NaN where the image says nothing.
        before: maps [-] predicted by the configured model, (nt, nz, nx).
        after: maps [-] predicted with the kept effects, (nt, nz, nx).
        error_before: relative L2 error of `before`.
        error_after: relative L2 error of `after`.
        noise_floor: relative L2 error of true maps, from noise and blur (see `bounded_floor`).
        point_spread_width: width [cells] over which the camera blurs maps.
        parts: parts of `error_after`; None where they were not measured.
        level_known: whether the level of the stock in `observed` is known; a calibration on the
            same rig leaves it open.
    """

    times: FloatArray
    observed: FloatArray
    before: FloatArray
    after: FloatArray
    error_before: float
    error_after: float
    noise_floor: float
    point_spread_width: float
    parts: ErrorParts | None = None
    level_known: bool = True

    @property
    def remainder(self) -> FloatArray:
        """Root mean square over the frames of after - observed [-], (nz, nx); 0 if never seen."""
        known = np.isfinite(self.observed)
        square = np.where(known, self.after - self.observed, 0.0) ** 2
        return np.asarray(np.sqrt(square.sum(axis=0) / np.maximum(known.sum(axis=0), 1)))

    def assuming_point_spread(self, width: float, noise: Noise) -> 'HeldOut':
        """Return the same part with the point spread `width` [cells] and its noise floor."""
        spread = replace(noise, point_spread_width=width)
        floor = bounded_floor(spread, self.after, self.observed)
        return replace(self, noise_floor=floor, point_spread_width=width)

    def camera_errors(self) -> tuple[float, float]:
        """Return the relative L2 errors before and after, with blur and level of the camera."""
        before, after = (
            self._at_level(blurred(maps, self.point_spread_width))
            for maps in (self.before, self.after)
        )
        return relative_error(before, self.observed), relative_error(after, self.observed)

    def _at_level(self, maps: FloatArray) -> FloatArray:
        return maps if self.level_known else maps * best_level(maps, self.observed)

    def bootstrap(self, seed: int) -> FloatArray:
        """Return squared relative errors (before, after) of bootstrap draws, (DRAWS, 2).

        Blocks of frames and tiles of the map are drawn with replacement and independently, because
        errors are correlated in time and in space (pigeonhole bootstrap: Owen, Ann.
        Appl. Stat. 1 (2007) 386).
        """
        known = np.isfinite(self.observed)
        observed = np.where(known, self.observed, 0.0)
        norm = _block_sums(observed**2)
        before, after = (
            _block_sums(np.where(known, predicted - observed, 0.0) ** 2)
            for predicted in (self.before, self.after)
        )
        random = np.random.default_rng(seed)
        times, tiles = norm.shape
        drawn_times = random.multinomial(times, np.full(times, 1.0 / times), DRAWS)
        drawn_tiles = random.multinomial(tiles, np.full(tiles, 1.0 / tiles), DRAWS)

        def total(values: FloatArray) -> FloatArray:
            return np.einsum('dt,ts,ds->d', drawn_times, values, drawn_tiles)

        norms = np.maximum(total(norm), 1e-12)
        return np.stack([total(before) / norms, total(after) / norms], axis=1)


def measure_held_out(
    recording: Recording,
    sample: Sample,
    model: Fit,
    numerics: Numerics,
    crew: Executor | None = None,
) -> HeldOut:
    """Return the held-out part of `recording` without and with the effects of `model`.

    The blur is the one with the smallest difference of the prediction after and the observed maps.
    `crew` runs the simulations; None: the caller does.

    Raises:
        InputError: the model cannot run with the effects of `model`.
    """
    late = np.flatnonzero(recording.times >= sample.held_out_start)
    chosen = evenly_spread(late, MOST_MAPS)
    assert recording.maps is not None
    observed = np.stack([recording.maps[int(index)] for index in chosen]).astype(float)
    part = replace(sample, times=recording.times[chosen], observed=observed, fitted_frames=0)
    before, after = map(part.at_scale, before_and_after(part, model, numerics, crew))
    width = measure_point_spread_width(observed, after, sample.noise)
    frames = held_out_frames(sample)
    places = [int(np.abs(part.times - time).argmin()) for time in frames.times]
    cells = preset_named(ACCURATE).refinement(sample.grid)
    coarse = Forward(coarsened(frames, COARSER), preset=ACCURATE, refinement=cells, crew=crew)
    return HeldOut(
        recording.times[chosen],
        observed,
        before,
        after,
        part.relative_error(before),
        part.relative_error(after),
        bounded_floor(replace(sample.noise, point_spread_width=width), after, observed),
        width,
        error_parts(frames, after[places], np.clip(coarse.maps(model.effects), 0.0, 1.0), width),
        level_known=sample.shared_errors is None and sample.least_scale is None,
    )


def bounded_floor(noise: Noise, after: FloatArray, observed: FloatArray) -> float:
    """Return the relative L2 error of true maps, from noise and blur.

    The noise that imaging states counts as far as the error of the maps `after`, (nt, nz, nx),
    allows: a model that errs less proves that the noise is smaller. The noise that the maps
    themselves show is not bounded.
    """
    stated = noise_floor(noise, after, observed)
    if not noise.random:
        return stated
    measured = noise_floor(replace(noise, random=(), systematic=()), after, observed)
    known = np.isfinite(observed)
    blurred_after = blurred(after, noise.point_spread_width)
    left = min(relative_error(maps[known], observed[known]) for maps in (after, blurred_after))
    return max(measured, min(stated, left))


def remaining_parts(parts: Sequence[HeldOut]) -> ErrorParts | None:
    """Return the parts of the errors after of all recordings; None where none were measured."""
    each = [part.parts for part in parts if part.parts is not None]
    if not each:
        return None
    columns = zip(*(asdict(one).values() for one in each), strict=True)
    return ErrorParts(*map(root_mean_square, columns))


def gap_closed(before: float, after: float, floor: float) -> float:
    """Return the share of the gap above the noise `floor` that closes.

    share = (before - after) / (before - floor); 0 without a gap. It is above 1 where the error
    falls below the expected floor, and negative where the error grows.
    """
    gap = before - floor
    return (before - after) / gap if gap > LEAST_GAP else 0.0


def camera_errors(parts: Sequence[HeldOut]) -> tuple[float, float]:
    """Return the errors of all recordings before and after, with blur and level of the camera.

    Plain errors can mislead. An effect that thins the fringe of a plume, such as a nonlinear
    response, loses more at the blurred edge than it gains elsewhere. And maps that are 7 % too pale
    by their calibration fit a wrong model better than the true one if it is too pale as well.
    """
    before, after = zip(*(part.camera_errors() for part in parts), strict=True)
    return root_mean_square(before), root_mean_square(after)


def gap_closed_with_interval(parts: Sequence[HeldOut]) -> tuple[float, tuple[float, float]]:
    """Return the share of the gap of all recordings that closes, and its 90 % interval.

    The noise floor is an expected value, and the same in every bootstrap draw.
    """
    floor = root_mean_square([part.noise_floor for part in parts])
    closed = gap_closed(
        root_mean_square([part.error_before for part in parts]),
        root_mean_square([part.error_after for part in parts]),
        floor,
    )
    before, after = np.sqrt(
        np.mean([part.bootstrap(seed) for seed, part in enumerate(parts)], axis=0)
    ).T
    drawn = [gap_closed(*errors, floor) for errors in zip(before, after, strict=True)]
    low, high = np.percentile(drawn, INTERVAL_PERCENTILES)
    return closed, (min(float(low), closed), max(float(high), closed))


def root_mean_square(values: Sequence[float]) -> float:
    """Return the root mean square of `values`, the relative errors of several recordings."""
    return float(np.sqrt(np.mean(np.square(values))))


def _block_sums(values: FloatArray) -> FloatArray:
    """Return the sums of `values` (nt, nz, nx) over blocks of frames and tiles, (blocks, tiles)."""
    edges = [
        np.unique(np.linspace(0, size, count + 1).astype(int))[:-1]
        for size, count in zip(values.shape, (TIME_BLOCKS, *TILES), strict=True)
    ]
    for axis, starts in enumerate(edges):
        values = np.add.reduceat(values, starts, axis=axis)
    return values.reshape(len(values), -1)
