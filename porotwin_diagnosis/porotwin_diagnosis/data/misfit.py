"""The misfit of whitened residuals at the fronts of a plume.

The misfit m of one part of the recordings, fitted or held out, is

    m = sqrt(sum over counted cells of r^2 / number of observed front cells).

A cell counts if it holds tracer but not full stock, in the prediction or, beyond the noise, in the
observation. Noise alone must not select cells: inside a pale plume it would select low values only.
The divisor is the number of observed front cells, so neither an empty nor a full rig dilutes a gap.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.noise import TRACER_PRESENT
from porotwin_diagnosis.data.sample import FULL_STOCK, SMOOTHING_WIDTH, Sample


def misfit(samples: Sequence[Sample], residuals: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the misfit [-] of the fitted and of the held-out frames.

    `residuals` are whitened, (nt, nz', nx') for every one of `samples`.
    """
    squares = [
        residual**2 * counted_cells(sample, residual)
        for sample, residual in zip(samples, residuals, strict=True)
    ]
    return _root_mean_squares(samples, squares)


def noise_misfit(samples: Sequence[Sample], residuals: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the misfit [-] that noise alone would cause, for fitted and held-out frames.

    It is the misfit with r^2 replaced by its expected value from noise, in the cells that count for
    `residuals` (whitened, (nt, nz', nx') for every one of `samples`). It is at least the cost of
    the errors that all maps share. The two are not added, because the delivered random deviation
    at a front already contains the error of its place.
    """
    squares = [
        sample.expected_noise_squares * counted_cells(sample, residual)
        for sample, residual in zip(samples, residuals, strict=True)
    ]
    fitted, held_out = _root_mean_squares(samples, squares)
    shared = float(np.sqrt(np.mean([sample.expected_shared_square for sample in samples])))
    return max(fitted, shared), max(held_out, shared)


def with_squares(misfits: tuple[float, float], square: float) -> tuple[float, float]:
    """Return both `misfits` [-] with `square` more of their squares."""
    fitted, held_out = np.sqrt(np.square(misfits) + square)
    return float(fitted), float(held_out)


def front_cells(samples: Sequence[Sample]) -> tuple[int, int]:
    """Return the numbers of observed front cells, of the fitted and of the held-out frames."""
    counts = [
        int(np.count_nonzero(sample.front_mask[part]))
        for sample in samples
        for part in _parts(sample)
    ]
    return max(sum(counts[::2]), 1), max(sum(counts[1::2]), 1)


def _parts(sample: Sample) -> tuple[slice, slice]:
    """Return the fitted and the held-out frames of `sample`."""
    return slice(None, sample.fitted_frames), slice(sample.fitted_frames, None)


def counted_cells(sample: Sample, residual: FloatArray) -> NDArray[np.bool_]:
    """Return where a cell counts for a whitened `residual`, (nt, nz', nx')."""
    weight = sample.weight(SMOOTHING_WIDTH)
    predicted = sample.smoothed_observed - residual / np.where(weight > 0, weight, np.inf)
    highest = np.maximum(sample.smoothed_observed, predicted)
    lowest = np.minimum(sample.upper_limit, predicted)
    return (highest > TRACER_PRESENT) & (lowest < FULL_STOCK)


def _root_mean_squares(
    samples: Sequence[Sample], squares: Sequence[FloatArray]
) -> tuple[float, float]:
    sums = np.zeros(2)
    for sample, square in zip(samples, squares, strict=True):
        sums += [float(square[part].sum()) for part in _parts(sample)]
    fitted, held_out = np.sqrt(sums / front_cells(samples))
    return float(fitted), float(held_out)
