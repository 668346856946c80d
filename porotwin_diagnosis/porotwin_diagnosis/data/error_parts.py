"""The parts of the error that remains beside the held-out maps: camera, scheme, noise, model.

The parts add in squares to the whole error e:

    e^2 = camera^2 + noise^2 + scheme^2 + rest^2.

camera: size of the blur of the camera and of the most probable of the errors that the calibration
states (`shared_errors`); no more than by which the error falls with them. noise: its expected size.
scheme: the change of the maps on cells twice as large. Errors fall by about half where cells do;
those of sharp fronts fall by less, and are then larger. rest: the description of rig and rates.
"""

from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, conservative_resample, relative_error
from porotwin_diagnosis.data.noise import blurred, noise_floor
from porotwin_diagnosis.data.sample import Sample

COARSER = 2
"""Cells of the recording per cell of a coarser simulation, each way."""


@dataclass(frozen=True)
class ErrorParts:
    """Parts of a relative L2 error [-]; the module explains them."""

    camera: float
    noise: float
    scheme: float
    rest: float


def held_out_frames(sample: Sample) -> Sample:
    """Return `sample` with its held-out frames alone."""
    late, own = slice(sample.fitted_frames, None), sample.own_deviation
    return replace(
        sample,
        times=sample.times[late],
        observed=sample.observed[late],
        own_deviation=None if own is None else own[late],
        fitted_frames=0,
    )


def error_parts(
    late: Sample, predicted: FloatArray, coarse: FloatArray, point_spread_width: float
) -> ErrorParts:
    """Return the parts of the error of `predicted`.

    Args:
        late: the held-out frames, see `held_out_frames`.
        predicted: maps of the model at their times [-], (nt, nz, nx).
        coarse: maps of the same scheme, with as many parts of a cell, on cells `COARSER` times as
            large [-].
        point_spread_width: width [cells] over which the camera blurs maps.
    """
    spread = blurred(predicted, point_spread_width)
    seen = spread + late.camera_change(predicted, point_spread_width)
    whole = late.relative_error(predicted)
    stated = relative_error(late.observed + seen - predicted, late.observed)
    camera = min(_rest(whole, late.relative_error(seen)), stated)
    random = replace(
        late.noise, point_spread_width=0.0, systematic=late.noise.systematic and (0.0,)
    )
    noise = min(noise_floor(random, spread, late.observed), _rest(whole, camera))
    finer = np.stack([conservative_resample(one, coarse.shape[1:]) for one in predicted])
    # a model without tracer has no error of its scheme
    change = relative_error(coarse, finer) if predicted.any() else 0.0
    scheme = min(change, _rest(whole, camera, noise))
    return ErrorParts(camera, noise, scheme, _rest(whole, camera, noise, scheme))


def _rest(whole: float, *parts: float) -> float:
    """Return what is left of `whole` beside `parts`, in squares."""
    return float(np.sqrt(max(whole**2 - sum(part**2 for part in parts), 0.0)))


def in_words(parts: ErrorParts) -> str:
    """Return the parts of an error in words."""
    return (
        f'camera {percent(parts.camera, 1)}, scheme {percent(parts.scheme, 1)}, noise '
        f'{percent(parts.noise, 1)}; {percent(parts.rest, 1)} are left for rig and rates (the '
        'squares add up)'
    )
