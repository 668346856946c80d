"""Nonlinear sorption in equilibrium (Freundlich): sorbed = capacity * dissolved ** exponent."""

import numba
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]


@numba.njit(cache=True, nogil=True)
def dissolved_in_equilibrium(total: FloatArray, capacity: float, exponent: float) -> FloatArray:
    """Return the dissolved part c of `total` = c + capacity c^exponent, per pore volume.

    By Newton's method in log c from above, where the sum is convex: it never overshoots.
    """
    dissolved = np.zeros_like(total)
    flat, result = total.ravel(), dissolved.ravel()
    for n in range(flat.size):
        if flat[n] < 1e-12:
            continue
        u = np.log(flat[n])
        for _ in range(50):
            c = np.exp(u)
            sorbed = capacity * c**exponent
            change = (c + sorbed - flat[n]) / (c + exponent * sorbed)
            u -= change
            if abs(change) < 1e-12:
                break
        result[n] = np.exp(u)
    return dissolved
