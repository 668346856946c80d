"""COBYLA, a local search without derivatives (Powell, Advances in Optimization, 1994, 51-67)."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from porotwin_core.geometry.grid import FloatArray
from porotwin_hub.control.setpoint_limits import Limits

FIRST_STEP = 0.25
"""First change of a variable, as a share of the largest rate: far enough to leave a flat region."""

LAST_STEP = 2e-3
"""Smallest change of a variable, as a share of the largest rate: 1 ml/h of 500."""


def search(
    cost: Callable[[FloatArray], float],
    start: FloatArray,
    *,
    limits: Limits,
    typical_cost: float,
    evaluations: int,
) -> None:
    """Evaluate `cost` along the path of COBYLA from `start` (wells,) [m^3/s].

    The variables are the rates divided by the largest rate, the cost is divided by `typical_cost`.
    The constraints are 0 <= rate <= max_rate for every well and sum(rates) <= max_total_rate.
    COBYLA may end on a worse point than it saw, so the caller keeps the best. Before SciPy 1.16 it
    could end at once where constraints tie, as in the corner of no flow, so it starts beside it.
    """
    scale = limits.max_rate
    wells = range(len(limits.wells))
    lower = [{'type': 'ineq', 'fun': lambda c, i=i: c[i]} for i in wells]
    upper = [{'type': 'ineq', 'fun': lambda c, i=i: 1.0 - c[i]} for i in wells]
    total = {'type': 'ineq', 'fun': lambda c: limits.max_total_rate / scale - c.sum()}
    minimize(
        lambda c: cost(c * scale) / typical_cost,
        np.clip(start / scale, LAST_STEP, 1.0 - LAST_STEP),
        method='COBYLA',
        constraints=[*lower, *upper, total],
        options={'rhobeg': FIRST_STEP, 'tol': LAST_STEP, 'maxiter': evaluations},
    )
