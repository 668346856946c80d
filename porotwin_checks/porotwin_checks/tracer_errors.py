"""How far the tracer in right maps may lie from the tracer by the pumps: one model of the errors.

A map at a time with the stock V in the rig shows the volume

    scale V + change + clean.

`scale` is the same in all maps: wrong rates, depth, porosity, sizes or calibration. `change`
differs from map to map: light, and sand. `clean` is the sum over sand without tracer.

The 22 recordings of another simulator in `shared/cases`, which have noise and shake, show at most
0.4 % of the pores before any injection, and 0.71 to 1.17 of the injected stock at their end.
"""

SCALE = 1.5
"""Largest believable scale, and its inverse the least one [-]."""

CHANGE = 0.1
"""Largest change, over the largest stock [-]. Calibrated maps of a rig as described have 0.05."""

CLEAN = 0.01
"""Volume over the pores of the rig that clean sand may show, and that is no plume yet [-]."""


def contradict(held: float, expected: float, pores: float) -> bool:
    """Return whether a map that holds `held` stock cannot be one of `expected`, all [m^3]."""
    low, high = sorted((held, expected))
    return high - low >= CLEAN * pores and high >= SCALE * low


def believed_change(stock: float, pores: float) -> float:
    """Return the largest believable change [m^3] of maps that hold up to `stock` [m^3]."""
    return max(CHANGE * stock, CLEAN * pores)
