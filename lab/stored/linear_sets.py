"""The sets of effects of a stored recording near their best fits, as linear models.

A set leaves the whitened residual r, and its parameters move it by their slopes J. Errors that no
effect makes move it by modes of one standard deviation:

| error | modes | deviation |
| --- | --- | --- |
| scheme | correction of the cells, in both parts of the recording | `SCHEME_SHARE` of it |
| sand | response to the waves of log permeability that are believed | `ROUGHNESS`, long waves |
| camera | level, bend, light, place (2), blur | `CAMERA` |
| calibration of photographs | those of `data.shared_errors` | as the maps state |

*Something else* is a smooth random field of a source, of a displacement in x and z, or of a
spreading: the modes `c`, dc/dx, dc/dz and the Laplacian of c times waves in time, height and width.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.misfit import counted_cells
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, STRIDE, Sample, at_compared_cells
from porotwin_diagnosis.data.shared_errors import error_modes, sands_of
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.search.effect_sets import correlated_cells
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.ranking import effect_and_well
from porotwin_solver.effects.wave import DEVIATION, believed

CAMERA = {'level': 0.01, 'bend': 0.01, 'light': 0.01, 'place': 0.1, 'blur': 0.1}
"""Deviations of the camera's errors: shares of the stock, a tenth of a cell and of its square."""

SCHEME_SHARE = 0.3
"""Share of the correction of the scheme that is unknown: the extrapolation factor 1.6 lies between
the 1 to 2.3 that the observed orders of convergence ask for."""

ROUGHNESS = 0.05
"""Deviation of the logarithm of the permeability: a porosity that varies by 1 % makes that much by
the relation of Kozeny and Carman (Bear, Dynamics of Fluids in Porous Media, section 5.10)."""

SOURCE, DISPLACEMENT, SPREADING = 0.1, 1.0, 1.0
"""Deviations of the random fields at amplitude 1: share of the stock, cells, squares of cells."""

WAVES = (3, 3, 4)
"""Waves of a random field in time, height and width."""


class LinearSet(NamedTuple):
    """A set near its best fit: the normal equations of A = (J P, B, F), P its prior deviations.

    Attributes:
        names: its effects.
        square: r.r of the whitened residual r (n,).
        gram: A^T A, (k, k).
        moments: A^T r, (k,).
        mean: prior mean of the amplitudes of A, (k,).
    """

    names: tuple[str, ...]
    square: float
    gram: FloatArray
    moments: FloatArray
    mean: FloatArray


class LinearRecording(NamedTuple):
    """The computed responses of a recording.

    Attributes:
        sets: the judged sets, the one without effects first.
        fields: number of the last amplitudes, those of the random fields F.
        cells: number n of cells that count for any set.
        noise: mean square of the residual that noise alone leaves in them [-].
        correlated: cells of a map that share one independent error.
        singles: number of single effects that the search tried.
    """

    sets: tuple[LinearSet, ...]
    fields: int
    cells: int
    noise: float
    correlated: float
    singles: int


def recording_of(levels: Levels, findings: Findings) -> LinearRecording:
    """Return the responses of a recording near the judged fits of its search."""
    return linear_recording(levels, judged_fits(findings), tried_singles(findings))


def tried_singles(findings: Findings) -> int:
    """Return the number of different single effects that a search tried."""
    return len({effect_and_well(fit) for fit in findings.screened})


def judged_fits(findings: Findings) -> list[Fit]:
    """Return the fits of a search whose evidence counts, the model without effects first."""
    return [findings.null, *findings.singles, *findings.pairs[:6], *findings.triples[:3]]


def linear_recording(levels: Levels, fits: Sequence[Fit], singles: int) -> LinearRecording:
    """Return the responses near judged `fits` of a recording, the first without effects.

    `singles` is the number of single effects that were tried.
    """
    sample, refining, width = levels.judging.samples[0], unshared(levels.refining), SMOOTHING_WIDTH
    weight = sample.weight(width)
    near = [unshared(levels.corrected_at(fit).judging) for fit in fits]
    residuals = [one.residuals(fit.effects, width)[0] for one, fit in zip(near, fits, strict=True)]
    counted = np.any([counted_cells(sample, r) for r in residuals], axis=0)
    known = [one.forwards[0].correction for one in near if one.forwards[0].correction is not None]
    scheme = [at_compared_cells(SCHEME_SHARE * one, width) * weight for one in known[:1]]
    here = refining.residuals((), width)[0]
    sand = [
        ROUGHNESS / DEVIATION * (refining.residuals([wave.described([1.0])], width)[0] - here)
        for wave in believed(sample.rig)
    ]
    c = np.clip(sample.smoothed_observed, 0.0, 1.0)
    fields = random_fields(c, weight, STRIDE)
    shared = [*in_parts(scheme, sample.fitted_frames), *sand, *camera_modes(c, weight, STRIDE)]
    shared += [at_compared_cells(one, width) * weight for one in calibration_modes(sample)]
    modes = np.stack([*shared, *fields])[:, counted]
    sets = []
    for fit, residual in zip(fits, residuals, strict=True):
        slopes = np.zeros((0, *residual.shape))
        if fit.members:
            own = refining.residuals(fit.effects, width)
            slopes = refining.slopes(fit.members, fit.scaled_parameters, own, fitted_only=False)[0]
        names = tuple(member.effect for member in fit.members)
        sets.append(linear_set(names, residual[counted], slopes[:, counted], modes, fit))
    return LinearRecording(
        tuple(sets),
        len(fields),
        int(counted.sum()),
        float(np.mean(sample.expected_noise_squares[counted])),
        correlated_cells(sample, width),
        singles,
    )


def unshared(fitter: Fitter) -> Fitter:
    """Return `fitter` with residuals from which no shared error was taken: they are modes here."""
    samples = [replace(sample, shared_errors=None) for sample in fitter.samples]
    pairs = zip(fitter.forwards, samples, strict=True)
    return replace(fitter, forwards=[replace(one, sample=sample) for one, sample in pairs])


def calibration_modes(sample: Sample) -> FloatArray:
    """Return the modes (k, nt, nz, nx) [-] of the errors of a calibration; without one k is 0."""
    maps, seen = sample.observed_or_zero, sample.seen_mask
    if sample.shared_errors is None:
        return np.zeros((0, *maps.shape))
    sands = sands_of(sample.rig, sample.grid)
    return error_modes(sample.shared_errors, maps, sands, sample.grid) * seen


def linear_set(
    names: tuple[str, ...], residual: FloatArray, slopes: FloatArray, modes: FloatArray, fit: Fit
) -> LinearSet:
    """Return the normal equations of a `fit` with a residual (n,), slopes (p, n), modes (k, n)."""
    deviations = prior_deviations(fit)
    matrix = np.concatenate([slopes * deviations[:, None], modes]).astype(float)
    mean = np.zeros(len(matrix))
    mean[: len(slopes)] = -fit.scaled_parameters / deviations
    r = residual.astype(float)
    return LinearSet(names, float(r @ r), matrix @ matrix.T, matrix @ r, mean)


def in_parts(modes: Sequence[FloatArray], fitted: int) -> list[FloatArray]:
    """Return each of `modes` (nt, ...) in the first `fitted` frames, and in the others."""
    early = [np.where(np.arange(len(mode))[:, None, None] < fitted, mode, 0.0) for mode in modes]
    return [part for mode, one in zip(modes, early, strict=True) for part in (one, mode - one)]


def camera_modes(c: FloatArray, weight: FloatArray, stride: int) -> list[FloatArray]:
    """Return the modes of the camera's errors for the maps `c` (nt, nz, nx)."""
    slope_z, slope_x, bend = derivatives(c, stride)
    time = np.linspace(-1.0, 1.0, len(c))[:, None, None]
    modes = (
        CAMERA['level'] * c,
        CAMERA['bend'] * 4.0 * c * (1.0 - c),
        CAMERA['light'] * time * c,
        CAMERA['place'] * slope_x,
        CAMERA['place'] * slope_z,
        CAMERA['blur'] * bend,
    )
    return [mode * weight for mode in modes]


def derivatives(c: FloatArray, stride: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return d/dz, d/dx and the Laplacian of `c` per cell of the recording."""
    slope_z, slope_x = (np.gradient(c, stride, axis=axis) for axis in (1, 2))
    bend = np.gradient(slope_z, stride, axis=1) + np.gradient(slope_x, stride, axis=2)
    return np.asarray(slope_z), np.asarray(slope_x), np.asarray(bend)


def random_fields(c: FloatArray, weight: FloatArray, stride: int) -> FloatArray:
    """Return the modes of a source, of a displacement and of a spreading, (4 waves, nt, nz, nx)."""
    slope_z, slope_x, bend = derivatives(c, stride)
    kinds = (SOURCE, DISPLACEMENT * slope_x, DISPLACEMENT * slope_z, SPREADING * bend)
    axes = [cosines(n, most) for n, most in zip(c.shape, WAVES, strict=True)]
    waves = [np.einsum('t,z,x->tzx', *wave) for wave in product(*axes)]
    return np.stack([kind * weight * wave for kind in kinds for wave in waves]).astype(np.float32)


def cosines(points: int, most: int) -> list[FloatArray]:
    """Return the first `most` cosines over `points` points, with a mean square of about 1."""
    x = (np.arange(points) + 0.5) / points
    return [np.sqrt(2.0 - (k == 0)) * np.cos(np.pi * k * x) for k in range(most)]


def prior_deviations(fit: Fit) -> FloatArray:
    """Return the prior deviations of the scaled parameters of `fit`, (p,).

    A place is anywhere in its range.
    """
    parameters = [parameter for member in fit.members for parameter in member.parameters]
    return np.array(
        [
            (one.range[1] - one.range[0]) / np.sqrt(12.0)
            if one.name in ('x', 'z')
            else one.prior_deviation
            for one in parameters
        ],
        dtype=float,
    )
