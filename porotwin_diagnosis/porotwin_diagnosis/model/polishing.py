"""The last refinement of a fit, on fine cells with the slopes of coarser ones."""

from collections.abc import Sequence

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.levenberg_marquardt import minimise
from porotwin_diagnosis.data.misfit import front_cells
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.model.fit import Fit, effects_at
from porotwin_diagnosis.model.fitter import Fitter, all_of_the_camera, bounds_of
from porotwin_diagnosis.thresholds import MOVING_PRICE

ITERATIONS = 4
"""Iterations with the slopes of a coarser fitter."""

TRIALS = 1
"""Trial steps per iteration with such slopes: if the first fails, they are no longer good."""


def polished(fitter: Fitter, fit: Fit, coarser: Fitter) -> Fit:
    """Return `fit` refined on the cells of `fitter` with the slopes of a `coarser` one.

    Both fitters have nearly the same slopes. So an iteration takes one simulation on fine cells
    instead of one per parameter. If the result is not feasible, `fit` itself is evaluated. The
    held-out frames are judged with the parameters of `held_out_parameters`.
    """
    if all_of_the_camera(fit.members):
        start = fit.scaled_parameters
        refined = fitter.fit(fit.members, start=start, coarse_steps=0, fine_steps=1)
        return _judged(fitter, refined, fitter)
    return _judged(fitter, _refined(fitter, fit, coarser), coarser)


def _refined(fitter: Fitter, fit: Fit, coarser: Fitter) -> Fit:
    members, start = fit.members, fit.scaled_parameters
    try:
        residuals = coarser.residuals(fit.effects, SMOOTHING_WIDTH, fitted_only=True)
    except InputError:
        return fitter.evaluate(members, start)
    slopes = coarser.slopes(members, start, residuals)
    scaled = fitter.minimised(
        members,
        start,
        SMOOTHING_WIDTH,
        ITERATIONS,
        slopes_at=lambda _parameters, _residuals: slopes,
        trials=TRIALS,
        updated_slopes=True,
    )
    refined = fitter.evaluate(members, scaled)
    return refined if refined.is_feasible else fitter.evaluate(members, start)


def _judged(fitter: Fitter, fit: Fit, coarser: Fitter) -> Fit:
    if not fit.is_feasible or fit.held_out_misfit <= fit.fitted_misfit:
        return fit
    try:
        suited = held_out_parameters(fitter, fit, coarser)
    except InputError:
        return fit
    return fitter.evaluate(fit.members, fit.scaled_parameters, held_out_parameters=suited)


def held_out_parameters(fitter: Fitter, fit: Fit, coarser: Fitter) -> FloatArray:
    """Return the scaled parameters (p,), near those of `fit`, that suit the held-out frames.

    The fitted frames leave parameters uncertain, and the uncertainty can grow in the held-out ones:
    5 mm do not matter until a front reaches the leak. An effect is contradicted only if no
    parameters near the fitted ones explain the held-out frames. A change d of the parameters costs
    the misfit that it adds to the fitted frames. This sum is minimised:

        |r - J d|^2 / n + P |J_fitted d|^2 / n_fitted

    r is the residual of the held-out frames, J are their slopes, taken on the cells of `coarser`, n
    are the numbers of front cells, and P is `MOVING_PRICE`.

    Raises:
        InputError: the model cannot run with `fit` on the cells of the `coarser` fitter.
    """
    members, start = fit.members, fit.scaled_parameters
    fitted_cells, held_out_cells = front_cells(fitter.samples)
    slopes = _held_out(fitter.samples, coarser.responses(members, start), held_out_cells)
    before = coarser.residuals(fit.effects, SMOOTHING_WIDTH, fitted_only=True)
    weight = np.sqrt(MOVING_PRICE / fitted_cells)
    price = weight * _square_root(coarser.slopes(members, start, before))

    def residuals(moved: FloatArray) -> list[FloatArray]:
        left = fitter.residuals(effects_at(members, moved), SMOOTHING_WIDTH)
        return [*_held_out(fitter.samples, left, held_out_cells), price @ (start - moved)]

    return minimise(
        residuals,
        lambda _parameters, _residuals: [*slopes, price.T],
        start,
        bounds_of(members),
        iterations=1,
        trials=TRIALS,
    )


def _held_out(
    samples: Sequence[Sample], residuals: Sequence[FloatArray], cells: int
) -> list[FloatArray]:
    """Return the held-out frames of residuals or slopes, divided by sqrt(`cells`)."""
    return [
        residual[..., sample.fitted_frames :, :, :] / np.sqrt(cells)
        for sample, residual in zip(samples, residuals, strict=True)
    ]


def _square_root(slopes: Sequence[FloatArray]) -> FloatArray:
    """Return a matrix R (p, p) with R^T R = J^T J, for the `slopes` J (p, ...) per recording."""
    flat = np.concatenate([columns.reshape(len(columns), -1) for columns in slopes], axis=1)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
