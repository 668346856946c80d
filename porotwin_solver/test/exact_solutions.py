"""Exact solutions of flow and transport, to verify the model; each with its equation and source."""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import trapezoid
from scipy.special import airye, erfc, erfcx

from porotwin_core.geometry.grid import FloatArray

TALBOT_POINTS = 32
"""Points of the inversion of Laplace transforms; double precision allows no more digits."""

STREAMLINES = 20_000
"""Streamlines between the wells of a doublet; the integral over them is right to 1e-6."""


def advancing_front(x: FloatArray, time: float, *, velocity: float, diffusion: float) -> FloatArray:
    """Return c(x, t), in the shape of `x` [m], in an empty column that is flushed with c = 1.

    dc/dt + v dc/dx = D d2c/dx2, with the flux v c - D dc/dx = v at the inlet x = 0. `time` t [s],
    `velocity` v [m/s], `diffusion` D [m^2/s]. The problem of Ogata and Banks (USGS Prof. Paper
    411-A, 1961) with the inlet of van Genuchten and Alves (USDA Tech. Bull. 1661, 1982, case A2),
    which conserves the tracer.
    """
    spread = 2.0 * math.sqrt(diffusion * time)
    behind = (x - velocity * time) / spread
    ahead = (x + velocity * time) / spread
    gauss = np.exp(-(behind**2))
    # exp(v x / D) erfc(ahead) = exp(-behind^2) erfcx(ahead), without overflow
    return (
        0.5 * erfc(behind)
        + math.sqrt(velocity**2 * time / (math.pi * diffusion)) * gauss
        - 0.5
        * (1.0 + velocity * x / diffusion + velocity**2 * time / diffusion)
        * gauss
        * erfcx(ahead)
    )


def radial_dispersion(
    radius: FloatArray, time: float, *, strength: float, dispersivity: float, well: float
) -> FloatArray:
    """Return c(r, t), in the shape of `radius` r [m], about a well that injects c = 1.

    dc/dt = (A a / r) d2c/dr2 - (A / r) dc/dr, with c - a dc/dr = 1 at the radius `well` [m].
    `strength` A [m^2/s]: the velocity is A / r; `dispersivity` a [m]: D = a A / r; `time` t [s].
    Laplace transform of Chen, Water Resour. Res. 23 (1987) 1069-1076, by Airy functions, inverted
    along Talbot's contour.
    """
    r, r0 = radius / dispersivity, well / dispersivity

    def transform(s: complex) -> FloatArray:
        def argument(at: FloatArray | float) -> FloatArray:
            return np.asarray((s * at + 0.25) / s ** (2.0 / 3.0))

        def power(at: FloatArray) -> FloatArray:
            return np.asarray(2.0 / 3.0 * at * np.sqrt(at))

        upper, lower = argument(r), argument(r0)
        airy, airy_prime = airye(lower)[:2]
        inlet = 0.5 * airy - s ** (1.0 / 3.0) * airy_prime
        decay = np.exp((r - r0) / 2.0 - power(upper) + power(lower))
        return np.asarray(decay * airye(upper)[0] / inlet / s)

    return invert_laplace(transform, strength * time / dispersivity**2)


def invert_laplace(transform: Callable[[complex], FloatArray], time: float) -> FloatArray:
    """Return the inverse of a Laplace transform at `time` > 0, in the shape of its values.

    Fixed Talbot method of Abate and Valko, Int. J. Numer. Meth. Eng. 60 (2004) 979-993.
    """
    scale = 2.0 * TALBOT_POINTS / (5.0 * time)
    total = 0.5 * np.exp(scale * time) * np.real(transform(complex(scale)))
    for k in range(1, TALBOT_POINTS):
        angle = k * math.pi / TALBOT_POINTS
        cotangent = 1.0 / math.tan(angle)
        s = scale * angle * complex(cotangent, 1.0)
        weight = complex(1.0, angle + (angle * cotangent - 1.0) * cotangent)
        total = total + np.real(np.exp(time * s) * transform(s) * weight)
    return total * scale / TALBOT_POINTS


def doublet_breakthrough(rate: float, *, distance: float, thickness: float) -> float:
    """Return the time [s] at which an injector's water reaches the producer in an unbounded rig.

    t = pi thickness distance^2 / (3 rate): Muskat, The Flow of Homogeneous Fluids (1937), sec. 9.8.
    `rate` [m^3/s], `distance` of the wells [m], `thickness`: depth times porosity [m].
    """
    return math.pi * thickness * distance**2 / (3.0 * rate)


def doublet_produced(until: float) -> float:
    """Return the tracer that a doublet produces up to the time `until`, in an unbounded rig.

    Times are in breakthrough times, the result in rate times breakthrough time. Water that leaves
    the injector at the angle a from the line to the producer arrives at 3 (1 - a cot a) / sin(a)^2.
    From then on, the fraction a / pi of the produced water is tracer.
    """

    def arrival(angle: FloatArray) -> FloatArray:
        return np.asarray(3.0 * (1.0 - angle / np.tan(angle)) / np.sin(angle) ** 2)

    angles = np.linspace(1e-3, math.pi - 0.05, STREAMLINES)
    times = arrival(angles)
    arrived = times <= until
    return float(trapezoid(angles[arrived] / math.pi, times[arrived]))


def sinking_blob(density_difference: float, *, conductivity: float) -> float:
    """Return the Darcy flux [m/s] downward inside a round denser blob in an unbounded rig.

    q = conductivity density_difference / 2: half the flux of a layer that spans the rig. The
    potential is the one of a dielectric cylinder (Jackson, Classical Electrodynamics, sec. 4.4).
    `density_difference` [kg/m^3]; `conductivity`: k g / mu [m^4/(kg s)].
    """
    return 0.5 * density_difference * conductivity
