"""The longest splitting step of a free run, which follows from how fast the water moves."""

import math

import numpy as np

from porotwin_core.basis.units import GRAVITY
from porotwin_core.rates.wells import WellRates
from porotwin_solver.coefficients.physics import Physics, in_and_out
from porotwin_solver.model.engine import LONGEST_STEP

EXCHANGED_SHARE = 1.0 / 1200.0
"""Share of the moving water that may be exchanged in a step. It gives `LONGEST_STEP` at the rates
of the paper's rigs, so that only slow rigs take longer steps. With 1/240 the fronts of other rigs
changed by a per cent, and a calibration that compares fronts with the model refused good ones."""

REACTED_SHARE = 0.05
"""Largest product of a step and a reaction rate: so much tracer reacts in one step."""

NOTABLE_FRACTION = 0.1
"""Fraction of immobile water below which its exchange bears longer steps, in proportion."""

COUPLED_SHARE = 1.0 / 240.0
"""Share of the moving water that may be pumped between two solutions of a flow that the tracer
changes. It gives `LONGEST_STEP` at 500 ml/h in the small rig."""


def longest_free_step(physics: Physics, rates: WellRates) -> float:
    """Return the longest splitting step [s] of a free run under constant `rates`.

    Slow rigs take long steps: the step is the time in which `EXCHANGED_SHARE` of the moving water
    is exchanged, but at least `LONGEST_STEP`. Pumps, leaks, flow from outside, density, a tilted
    water table and heads of open sides exchange water. Decay, exchange with immobile
    water, and diffusion from a side bound the step too.

    Two things need shorter steps than `LONGEST_STEP` where pumps are fast. A tracer that changes
    the flow needs a new flow after `COUPLED_SHARE`. Exchange with immobile water needs steps in
    which either little is exchanged or little water moves.
    """
    moving = physics.moving_volume
    flow = _pumped(physics, rates) + _driven(physics.at_levels(rates))
    exchange = physics.exchange_rate / max(1.0 - physics.immobile_fraction, 0.1)
    slow = EXCHANGED_SHARE * _over(moving, flow)
    reacted = REACTED_SHARE * _over(1.0, exchange)
    decayed = REACTED_SHARE * _over(1.0, physics.decay_rate)
    limits = [max(LONGEST_STEP, min(slow, reacted, decayed)), _diffused(physics)]
    if physics.immobile_fraction > 0.0:
        few = max(1.0, NOTABLE_FRACTION / physics.immobile_fraction)
        limits.append(few * max(reacted, slow))
    if physics.is_coupled:
        limits.append(COUPLED_SHARE * _over(moving, _pumped(physics, rates)))
    return min(limits)


def _diffused(physics: Physics) -> float:
    """Return the longest step [s] for diffusion through a side; inf without any."""
    if not any(side.any() for side in physics.contact.diffuses):
        return math.inf
    size = min(physics.grid.dx, physics.grid.dz)
    return REACTED_SHARE * _over(size**2, 2.0 * (physics.diffusion + physics.model_diffusion))


def _over(amount: float, rate: float) -> float:
    """Return the time [s] that `amount` takes at `rate`."""
    return amount / rate if rate > 0.0 else math.inf


def _pumped(physics: Physics, rates: WellRates) -> float:
    """Return the larger one of the injected and the withdrawn rate [m^3/s]."""
    leaks = (leak.rate for leak in physics.leaks)
    return max(in_and_out([*physics.delivered(rates).values(), *leaks]))


def _driven(physics: Physics) -> float:
    """Return the rate [m^3/s] at which outside flow, density and the water table move water."""
    grid = physics.grid
    gradient = abs(physics.density_difference) * GRAVITY
    gradient += abs(physics.table_tilt) / grid.width
    highest = physics.density * GRAVITY * physics.contact.highest
    gradient += highest / min(grid.width, grid.height)
    flux = math.hypot(*physics.background_flux)
    if gradient > 0.0:
        flux += gradient * float(np.max(physics.permeability)) / physics.viscosity
    if flux == 0.0:
        return physics.contact.rainfall
    depth = float(np.mean(physics.depth))
    return flux * depth * max(grid.width, grid.height) + physics.contact.rainfall
