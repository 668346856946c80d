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

COUPLED_SHARE = 1.0 / 60.0
"""Share of the moving water that pumps and density may exchange between two solutions of a flow
that the tracer changes. A plume that sinks alone (10 and 50 kg/m3, 20 cm) is then off by 5 and 1 %,
with steps of `LONGEST_STEP` by 32 and 53 %."""


def longest_free_step(physics: Physics, rates: WellRates) -> float:
    """Return the longest splitting step [s] of a free run under constant `rates`.

    Slow rigs take long steps: the step is the time in which `EXCHANGED_SHARE` of the moving water
    is exchanged, but at least `LONGEST_STEP`. Pumps, leaks, flow from outside, density, a tilted
    water table and heads of open sides exchange water. Decay, exchange with immobile
    water, and diffusion from a side bound the step too.

    Two things need shorter steps than `LONGEST_STEP` where water is fast. A tracer that changes
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
        limits.append(COUPLED_SHARE * _over(moving, _pumped(physics, rates) + _sunk(physics)))
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


def _sunk(physics: Physics) -> float:
    """Return the flow [m^3/s] that the density of stock drives."""
    return _seeped(physics, abs(physics.density_difference) * GRAVITY)


def _seeped(physics: Physics, gradient: float) -> float:
    """Return the rate [m^3/s] along the rig at a pressure gradient [Pa/m]."""
    flux = gradient * float(np.max(physics.permeability)) / physics.viscosity
    return flux * float(np.mean(physics.depth)) * max(physics.grid.width, physics.grid.height)


def _driven(physics: Physics) -> float:
    """Return the rate [m^3/s] at which outside flow, density and the water table move water."""
    grid = physics.grid
    gradient = abs(physics.table_tilt) / grid.width
    highest = physics.density * GRAVITY * physics.contact.highest
    gradient += highest / min(grid.width, grid.height)
    flux = math.hypot(*physics.background_flux)
    along = flux * float(np.mean(physics.depth)) * max(grid.width, grid.height)
    return along + _sunk(physics) + _seeped(physics, gradient) + physics.contact.rainfall
