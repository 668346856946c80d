"""The response of a dye or a light that saturates: one parameter from signal to concentration.

With s the signal relative to tracer stock, c the concentration and b the bend,

    s = (1 - exp(-a c)) / (1 - exp(-a)).

It starts at water (0, 0), ends at stock (1, 1) and is straight at b = 0. The parameter a follows
from the bend b = c(1/2) - 1/2.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[Any]

MOST_BEND = 0.3
"""Largest absolute bend [-]: stronger responses tell pale tracer from water or stock no more."""
_STRAIGHT_BEND = 1e-4
"""Weaker bends [-] count as straight; the formulas divide by the bend."""
_MOST_CURVATURE = 50.0
"""Bracket of the search for a; it belongs to a bend beyond `MOST_BEND`."""


def _inside(signal: Array, bend: float) -> Array:
    if abs(bend) < _STRAIGHT_BEND:
        return np.array(signal, float)
    curvature = _curvature(bend)
    return np.asarray(-np.log1p(signal * np.expm1(-curvature)) / curvature)


def _curvature(bend: float) -> float:
    """Return a of this bend."""

    def excess(curvature: float) -> float:
        return float(-np.log1p(0.5 * np.expm1(-curvature)) / curvature - 0.5 - bend)

    low, high = (1e-6, _MOST_CURVATURE) if bend < 0 else (-_MOST_CURVATURE, -1e-6)
    return float(brentq(excess, low, high))


def concentration_of(signal: Array, bend: float) -> Array:
    """Return the concentration [-] of relative signals, of the same shape.

    Below water and above stock the curve continues straight, with the slope of its chord over the
    nearest tenth. So noise about water and stock keeps its mean.

    Args:
        signal: signal relative to tracer stock [-].
        bend: see the module [-], between -`MOST_BEND` and `MOST_BEND`.
    """
    inside = _inside(np.clip(signal, 0.0, 1.0), bend)
    low, high = _inside(np.array([0.1, 0.9]), bend)
    below, above = np.minimum(signal, 0.0), np.maximum(np.asarray(signal) - 1.0, 0.0)
    return np.asarray(inside + 10.0 * low * below + 10.0 * (1.0 - high) * above)
