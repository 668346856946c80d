"""The error of every frame over time, without and with the effects that were found."""

from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.noise import noise_floor
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.numerics import before_and_after
from porotwin_diagnosis.diagnosis import Diagnosis

FAINT = 0.15
"""Frames whose tracer has less than this share of the largest norm are left out: their relative
error would be divided by almost nothing."""


@dataclass(frozen=True)
class ErrorCourse:
    """Relative L2 errors over time.

    Attributes:
        times: times of the frames [s], (nt,).
        before: errors of the model as it is configured, (nt,).
        after: errors of the model with the effects that were found, (nt,).
        floor: errors that noise and blur alone would make, (nt,).
        held_out_start: start of the held-out part [s].
    """

    times: FloatArray
    before: FloatArray
    after: FloatArray
    floor: FloatArray
    held_out_start: float


def error_course(result: Diagnosis, number: int = 0) -> ErrorCourse:
    """Return the errors of recording `number`: of the fitted frames and of all held-out ones.

    The fitted part takes two simulations; the held-out part is in `result`.
    """
    sample, part = result.samples[number], result.held_out[number]
    early = fitted_part(sample)
    before, after = before_and_after(early, result.verdict.model, result.evidence.numerics)
    observed = np.concatenate([early.observed, part.observed])
    before = np.concatenate([before, part.before])
    after = np.concatenate([after, part.after])
    noise = replace(sample.noise, point_spread_width=part.point_spread_width)
    norms = np.array([np.linalg.norm(np.nan_to_num(frame)) for frame in observed])
    clear = np.flatnonzero(norms > FAINT * norms.max())

    def errors(predicted: FloatArray) -> FloatArray:
        wrong = np.nan_to_num(predicted - observed)
        return np.array([np.linalg.norm(wrong[index]) / norms[index] for index in clear])

    floor = [noise_floor(noise, after[[index]], observed[[index]]) for index in clear]
    return ErrorCourse(
        np.concatenate([early.times, part.times])[clear],
        errors(before),
        errors(after),
        np.array(floor),
        sample.held_out_start,
    )


def fitted_part(sample: Sample) -> Sample:
    """Return `sample` with only the frames that the fits saw."""
    end = sample.fitted_frames
    return replace(sample, times=sample.times[:end], observed=sample.observed[:end])
