"""Nonlinear least squares within bounds, by the method of Levenberg and Marquardt.

With residuals r(u) and slopes J = -dr/du, a step p solves

    (J^T J + damping diag(J^T J)) p = J^T r

(Nocedal & Wright, Numerical Optimization, section 10.3). Parameters at a bound whose step points
outward are kept fixed. The residuals come as a list of arrays, one per recording.

Slopes that are dear need not be taken anew in every iteration. Broyden's update corrects them so
that they explain the latest step p, with the change of the residuals (Math. Comput. 19 (1965) 577):

    J <- J + (r_before - r_after - J p) p^T / (p^T p)
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import FloatArray

ResidualsFn = Callable[[FloatArray], Sequence[FloatArray]]
"""Returns the residuals at parameters (p,), one array of any shape per recording.

It raises `InputError` where the model cannot run."""

SlopesFn = Callable[[FloatArray, Sequence[FloatArray]], Sequence[FloatArray]]
"""Returns minus the derivatives of the residuals at parameters (p,), given the residuals there: one
array (p, ...) per recording."""

LEAST_GAIN = 5e-4
"""Relative decrease of the sum of squares below which the iteration ends: more iterations are not
worth their simulations."""

TRIALS = 6
"""Trial steps per iteration. With the growth of the damping the last one is about a hundredth of
the first."""

LEAST_STEP = 0.004
"""Largest component of a step [scaled] below which it is not taken. The scaled parameter of a well
position moves a front by about one cell, so that 0.004 is 0.4 % of a cell."""

LARGEST_STEP = 30.0
"""Largest change [scaled] of a parameter in one iteration. It stops a nearly singular matrix from
moving a parameter to its bound at once."""

FIRST_DAMPING = 1e-3
"""Damping of the first iteration: nearly a Gauss-Newton step."""

REJECTED_DAMPING, DAMPING_GROWTH, DAMPING_DECAY = 1e-2, 10.0, 0.2
"""Least damping after a rejected step, and the factors after a rejected and an accepted step."""


class Bounds(NamedTuple):
    """Scaled parameters [-]: the least ones `low` and the largest ones `high`, (p,) each."""

    low: FloatArray
    high: FloatArray

    def clip(self, parameters: FloatArray) -> FloatArray:
        """Return scaled `parameters` (p,), each moved to the nearest value within the bounds."""
        return np.clip(parameters, self.low, self.high)


def minimise(
    residuals_at: ResidualsFn,
    slopes_at: SlopesFn,
    start: FloatArray,
    bounds: Bounds,
    *,
    iterations: int,
    trials: int = TRIALS,
    updated_slopes: bool = False,
) -> FloatArray:
    """Return the parameters (p,) with the least sum of squares that at most `iterations` find.

    With `updated_slopes` the slopes are taken at `start` only, and updated after every step.

    An iteration that takes less than LEAST_GAIN of the sum is the last one. If the model cannot
    run at a trial step, the step is rejected and a shorter one is tried. If it cannot run at
    `start`, the result is `start` within the `bounds`.
    """
    parameters = bounds.clip(start)
    try:
        residuals = residuals_at(parameters)
    except InputError:
        return parameters
    cost = _sum_of_squares(residuals)
    damping = FIRST_DAMPING
    slopes: Sequence[FloatArray] = ()
    for _ in range(iterations):
        slopes = slopes if updated_slopes and slopes else slopes_at(parameters, residuals)
        normal, gradient = _normal_equations(slopes, residuals)
        for _ in range(trials):
            step = _bounded_step(normal, gradient, damping, parameters, bounds)
            if np.abs(step).max() < LEAST_STEP:
                return parameters
            trial = bounds.clip(parameters + step)
            trial_residuals, trial_cost = _tried(residuals_at, trial)
            if trial_cost < cost:
                break
            damping = max(DAMPING_GROWTH * damping, REJECTED_DAMPING)
        else:
            return parameters
        gain = 1.0 - trial_cost / cost
        if updated_slopes:
            slopes = _updated(slopes, trial - parameters, residuals, trial_residuals)
        parameters, residuals, cost = trial, trial_residuals, trial_cost
        damping *= DAMPING_DECAY
        if gain < LEAST_GAIN:
            break
    return parameters


def _updated(
    slopes: Sequence[FloatArray],
    step: FloatArray,
    before: Sequence[FloatArray],
    after: Sequence[FloatArray],
) -> list[FloatArray]:
    """Return `slopes` with Broyden's update for a `step` (p,) and the residuals on both sides."""
    share = step / float(step @ step)
    return [
        columns + np.multiply.outer(share, old - new - np.tensordot(step, columns, axes=(0, 0)))
        for columns, old, new in zip(slopes, before, after, strict=True)
    ]


def _tried(residuals_at: ResidualsFn, parameters: FloatArray) -> tuple[Sequence[FloatArray], float]:
    """Return the residuals and their sum of squares, infinite where the model cannot run."""
    try:
        residuals = residuals_at(parameters)
    except InputError:
        return (), np.inf
    return residuals, _sum_of_squares(residuals)


def _sum_of_squares(residuals: Sequence[FloatArray]) -> float:
    return float(sum(np.sum(residual**2) for residual in residuals))


def _normal_equations(
    slopes: Sequence[FloatArray], residuals: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return J^T J (p, p) and J^T r (p,), summed over the recordings."""
    size = len(slopes[0])
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for columns, residual in zip(slopes, residuals, strict=True):
        flat = columns.reshape(size, -1)
        normal += flat @ flat.T
        gradient += flat @ residual.ravel()
    return normal, gradient


def _bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    damping: float,
    parameters: FloatArray,
    bounds: Bounds,
) -> FloatArray:
    """Return the damped step (p,); parameters that would leave their bounds stay."""
    at_low = (parameters <= bounds.low) & (gradient < 0)
    at_high = (parameters >= bounds.high) & (gradient > 0)
    free = ~(at_low | at_high)
    step = np.zeros_like(gradient)
    if not free.any():
        return step
    part = normal[np.ix_(free, free)]
    diagonal = np.diag(part) + ROUND_OFF * max(float(np.trace(part)), np.finfo(float).tiny)
    step[free] = np.linalg.solve(
        part + np.diag(damping * diagonal + np.finfo(float).tiny), gradient[free]
    )
    return np.clip(step, -LARGEST_STEP, LARGEST_STEP)
