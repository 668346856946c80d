"""The spectral projected gradient: a local search whose every point keeps the limits.

Birgin, Martinez and Raydan, SIAM J. Optim. 10 (2000) 1196-1211, with a monotone line search. The
feasible set of one block is 0 <= rate <= greatest, sum(rates) <= total.
"""

from collections.abc import Callable

import numpy as np

from porotwin_core.geometry.grid import FloatArray

CostAndGradient = Callable[[FloatArray], tuple[float, FloatArray]]
"""From rates (blocks, wells) to their cost and its derivatives, in the same shape."""

SUFFICIENT_DECREASE = 1e-4
"""Share of the decrease by the slope that a step must reach (Armijo)."""

SHORTEST_STEP = 0.05
"""Share of a step below which the line search gives up: the cost has a kink there."""

LONGEST_GROWTH = 4.0
"""Growth of the step length where the curvature is not positive."""

HALVINGS = 50
"""Bisections for the multiplier of the sum: to round-off."""


def project(rates: FloatArray, greatest: FloatArray, total: float) -> FloatArray:
    """Return the nearest rates (blocks, wells) within 0..`greatest` (wells,) and the sum `total`.

    The projection onto one block's set is clip(rate - m, 0, greatest), with the least m >= 0 that
    keeps the sum.
    """
    inside = np.clip(rates, 0.0, greatest)
    over = inside.sum(axis=1) > total
    low, high = np.zeros(over.sum()), rates[over].max(axis=1, initial=0.0)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = np.clip(rates[over] - middle[:, None], 0.0, greatest).sum(axis=1) > total
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    inside[over] = np.clip(rates[over] - high[:, None], 0.0, greatest)
    return inside


def descend(
    evaluate: CostAndGradient,
    start: FloatArray,
    *,
    lengths: FloatArray,
    greatest: FloatArray,
    total: float,
    iterations: int,
) -> FloatArray:
    """Return rates (blocks, wells) [m^3/s] of less cost than `start`, or `start` itself.

    Args:
        evaluate: the cost and its derivatives.
        start: rates within the limits.
        lengths: of the blocks [s]; the derivatives by rates are proportional to them.
        greatest: of each well's rate [m^3/s], (wells,).
        total: greatest sum of the rates in a block [m^3/s].
        iterations: most steps.
    """
    scale = (lengths.mean() / lengths)[:, None]
    largest = max(float(greatest.max(initial=0.0)), np.finfo(float).tiny)
    rates = project(start, greatest, total)
    cost, gradient = evaluate(rates)
    step = largest / max(float(np.abs(scale * gradient).max()), np.finfo(float).tiny)
    for _ in range(iterations):
        change = project(rates - step * scale * gradient, greatest, total) - rates
        slope = float(np.vdot(gradient, change))
        if np.abs(change).max() < 1e-3 * largest or slope >= 0.0:
            break
        share, found = 1.0, evaluate(rates + change)
        while found[0] > cost + SUFFICIENT_DECREASE * share * slope and share > SHORTEST_STEP:
            curvature = found[0] - cost - share * slope
            best = -0.5 * share * slope / max(curvature, np.finfo(float).tiny)
            share *= min(max(best, 0.1), 0.5)
            found = evaluate(rates + share * change)
        if found[0] >= cost:
            break
        moved, bent = share * change, found[1] - gradient
        along = float(np.vdot(moved, bent))
        length = float(np.vdot(moved, moved / scale))
        step = length / along if along > 0.0 else LONGEST_GROWTH * step
        rates, cost, gradient = rates + moved, found[0], found[1]
    return rates
