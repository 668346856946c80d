"""Exact solutions that the model is measured against: each with its equation and its source."""

import math
from collections.abc import Callable

import numpy as np
from scipy.special import airye, erfc, erfcx

from porotwin_core.grid import FloatArray


def radial_front(volume: float, *, thickness: float) -> float:
    """Return the radius [m] of the front about a single injector in an unbounded rig.

    pi r^2 thickness = volume, with `volume` [m^3] injected and `thickness` depth times porosity.
    """
    return math.sqrt(volume / (math.pi * thickness))


def advancing_front(x: FloatArray, time: float, *, velocity: float, diffusion: float) -> FloatArray:
    """Return c(x, t) in a column that is flushed with c = 1 from x = 0 on, initially empty.

    dc/dt + v dc/dx = D d2c/dx2 with the flux v c - D dc/dx = v given at the inlet: the problem of
    Ogata and Banks (USGS Prof. Paper 411-A, 1961) with the inlet of van Genuchten and Alves (USDA
    Tech. Bull. 1661, 1982, case A2), which conserves the tracer.
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
    """Return c(r, t) about a well of radius `well` [m] that injects c = 1, D = dispersivity * v.

    dc/dt = (A a / r) d2c/dr2 - (A / r) dc/dr with v = A / r, `strength` A [m^2/s], and the flux of
    tracer given at the well, c - a dc/dr = 1: Laplace transform of Chen, Water Resour. Res. 23
    (1987) 1069-1076, by Airy functions, inverted along Talbot's contour.
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
    """Return the original of a Laplace transform at `time` > 0.

    Fixed Talbot method of Abate and Valko, Int. J. Numer. Meth. Eng. 60 (2004) 979-993.
    """
    points = 32
    scale = 2.0 * points / (5.0 * time)
    total = 0.5 * np.exp(scale * time) * np.real(transform(complex(scale)))
    for k in range(1, points):
        angle = k * math.pi / points
        cotangent = 1.0 / math.tan(angle)
        s = scale * angle * complex(cotangent, 1.0)
        weight = complex(1.0, angle + (angle * cotangent - 1.0) * cotangent)
        total = total + np.real(np.exp(time * s) * transform(s) * weight)
    return total * scale / points


def doublet_breakthrough(rate: float, *, distance: float, thickness: float) -> float:
    """Return the time [s] at which an injector's water reaches the producer in an unbounded rig.

    t = pi thickness distance^2 / (3 rate), `thickness` depth times porosity: Muskat, The Flow of
    Homogeneous Fluids (1937), sec. 9.8.
    """
    return math.pi * thickness * distance**2 / (3.0 * rate)


def doublet_produced(until: float) -> float:
    """Return the tracer that the producer of a doublet has taken out by `until` breakthrough times.

    In units of rate times breakthrough time. The water that leaves the injector at the angle a from
    the line to the producer arrives at the time 3 (1 - a cot a) / sin(a)^2, and a / pi of what is
    produced is tracer by then.
    """

    def arrival(angle: FloatArray) -> FloatArray:
        return np.asarray(3.0 * (1.0 - angle / np.tan(angle)) / np.sin(angle) ** 2)

    angles = np.linspace(1e-3, math.pi - 0.05, 20_000)
    times = arrival(angles)
    arrived = times <= until
    return float(np.trapezoid(angles[arrived] / math.pi, times[arrived]))


def sinking_blob(density_difference: float, *, conductivity: float) -> float:
    """Return the Darcy flux [m/s] downward inside a round denser blob in an unbounded rig.

    q = k g density_difference / (2 mu): the blob moves as a whole at half of what a layer that
    spans the rig would (the potential of a disc, as a dielectric cylinder's); `conductivity`:
    k g / mu per density [m^4/(kg s)].
    """
    return 0.5 * density_difference * conductivity
