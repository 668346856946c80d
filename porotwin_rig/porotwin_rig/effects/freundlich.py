"""The tracer sorbs nonlinearly, in equilibrium: sorbed = capacity * dissolved ** exponent."""

import numba
import numpy as np
from numpy.random import Generator

from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.model.blind_draw import DrawContext, DrawnValues, log_uniform
from porotwin_core.model.effect_parameter import Parameter, Values
from porotwin_rig.effects.definition.asset_effect import AssetEffect, FloatArray
from porotwin_rig.tracer import Tracer
from porotwin_rig.true_rig import TrueRig

MOST_ITERATIONS = 50
"""Newton's method takes about six."""


@numba.njit(cache=True, nogil=True)
def dissolved_in_equilibrium(total: FloatArray, capacity: float, exponent: float) -> FloatArray:
    """Return the dissolved part c [-] of `total` = c + capacity c^exponent, per pore volume.

    `total` (nz + 1, nx + 1) and the result have the same shape; nothing has a unit.

    Newton's method in log c from above, where the sum is convex: it never overshoots.
    """
    dissolved = np.zeros_like(total)
    flat, result = total.ravel(), dissolved.ravel()
    for n in range(flat.size):
        if flat[n] < SMALLEST_DIVISOR:
            continue
        u = np.log(flat[n])
        for _ in range(MOST_ITERATIONS):
            c = np.exp(u)
            sorbed = capacity * c**exponent
            change = (c + sorbed - flat[n]) / (c + exponent * sorbed)
            u -= change
            if abs(change) < 1e-12:
                break
        result[n] = np.exp(u)
    return dissolved


def sorb(tracer: Tracer, _rig: TrueRig, values: Values, _duration: float) -> Tracer:
    """Return dissolved and sorbed tracer in equilibrium, their sum kept."""
    total = tracer.mobile + tracer.stationary
    mobile = dissolved_in_equilibrium(total, values['capacity'], values['exponent'])
    return Tracer(mobile, total - mobile)


def draw(generator: Generator, _context: DrawContext) -> DrawnValues:
    """Draw a capacity of 2 to 8 % of the pore volume, with a square root."""
    return {'capacity': log_uniform(generator, 0.02, 0.08), 'exponent': 0.5}


EFFECT = AssetEffect(
    name='freundlich',
    order=220,
    parameters={
        'capacity': Parameter(unit='-', low=0.0),
        'exponent': Parameter(unit='-', above=0.0, default=0.6, neutral=1.0),
    },
    shape=('exponent',),
    on_tracer=sorb,
    longest_step=5.0,
    blind_draw=draw,
    # at a sharp front of constant concentration sorption acts as if it were linear
    equal_to=('retardation', 'porosity'),
)
