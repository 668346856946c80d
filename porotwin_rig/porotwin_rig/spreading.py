"""Diffusion and dispersion over the vertices' boxes, by super time stepping.

d(s c)/dt = div(s D grad c) with s = storage [m] and Scheidegger's tensor
D = (a_T |v| + D_m) I + (a_L - a_T) v v^T / |v| (Bear 1972, sec. 10.4), v the pore velocity. No
tracer passes the walls. A stabilised explicit scheme takes large steps (RKL2; Meyer, Balsara &
Aslam 2014); its number of stages grows with the square root of the step.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from porotwin_rig.mesh import Mesh

FloatArray = NDArray[np.floating]


@dataclass(frozen=True)
class Spreading:
    """Coefficients of spreading.

    Args:
        diffusion: diffusion in the pores [m^2/s].
        longitudinal: dispersivity along the flow [m].
        transverse: dispersivity across the flow [m].
    """

    diffusion: float
    longitudinal: float
    transverse: float

    @property
    def follows_flow(self) -> bool:
        """Whether the tensor depends on the velocity."""
        return self.longitudinal > 0.0 or self.transverse > 0.0


@numba.njit(cache=True, nogil=True)
def _rate(
    c: FloatArray,
    xx: FloatArray,
    xz: FloatArray,
    zz: FloatArray,
    zx: FloatArray,
    mass: FloatArray,
    out: FloatArray,
) -> None:
    """Fill `out` = dc/dt [1/s]; conductances xx, xz on x faces, zz, zx on z faces [m^3/s]."""
    rows, columns = c.shape
    for j in range(rows):
        for i in range(columns):
            out[j, i] = 0.0
    for j in range(rows):
        below, above = max(j - 1, 0), min(j + 1, rows - 1)
        for i in range(columns - 1):
            flow = xx[j, i] * (c[j, i + 1] - c[j, i])
            if xz[j, i] != 0.0:
                flow += (
                    xz[j, i]
                    * (c[above, i] + c[above, i + 1] - c[below, i] - c[below, i + 1])
                    / (2.0 * (above - below))
                )
            out[j, i] += flow
            out[j, i + 1] -= flow
    for j in range(rows - 1):
        for i in range(columns):
            before, after = max(i - 1, 0), min(i + 1, columns - 1)
            flow = zz[j, i] * (c[j + 1, i] - c[j, i])
            if zx[j, i] != 0.0:
                flow += (
                    zx[j, i]
                    * (c[j, after] + c[j + 1, after] - c[j, before] - c[j + 1, before])
                    / (2.0 * (after - before))
                )
            out[j, i] += flow
            out[j + 1, i] -= flow
    for j in range(rows):
        for i in range(columns):
            out[j, i] /= mass[j, i]


def spread(
    mesh: Mesh,
    concentration: FloatArray,
    *,
    storage: FloatArray,
    spreading: Spreading,
    velocity: tuple[FloatArray, FloatArray] | None,
    duration: float,
) -> FloatArray:
    """Return `concentration` (nz + 1, nx + 1) after `duration` [s] of diffusion and dispersion.

    The mass, sum(concentration * storage * box area), is kept to round-off.

    Args:
        mesh: the mesh.
        concentration: of the mobile water at the vertices [-], (nz + 1, nx + 1).
        storage: porosity times depth times retardation [m], (nz + 1, nx + 1).
        spreading: diffusion and dispersivities.
        velocity: pore velocity (vx, vz) at the vertices [m/s], (nz + 1, nx + 1) each; None where
            nothing depends on it.
        duration: [s].
    """
    conductances, fastest = _conductances(mesh, storage, spreading, velocity)
    mass = storage * mesh.box_area
    return _super_step(concentration, conductances, mass, duration, fastest)


def _conductances(
    mesh: Mesh,
    storage: FloatArray,
    spreading: Spreading,
    velocity: tuple[FloatArray, FloatArray] | None,
) -> tuple[tuple[FloatArray, ...], float]:
    """Return the conductances of all faces and a bound of the fastest rate [1/s]."""
    height, width = mesh.box_height[:, None], mesh.box_width[None, :]
    across_x = 0.5 * (storage[:, 1:] + storage[:, :-1]) * height
    across_z = 0.5 * (storage[1:, :] + storage[:-1, :]) * width
    if velocity is None or not spreading.follows_flow:
        xx = across_x * (spreading.diffusion / mesh.hx)
        zz = across_z * (spreading.diffusion / mesh.hz)
        none_x, none_z = np.zeros_like(xx), np.zeros_like(zz)
        fastest = 8.0 * spreading.diffusion * (1.0 / mesh.hx**2 + 1.0 / mesh.hz**2)
        return (xx, none_x, zz, none_z), fastest
    x_tensor = _tensor(spreading, *(0.5 * (v[:, 1:] + v[:, :-1]) for v in velocity))
    z_tensor = _tensor(spreading, *(0.5 * (v[1:, :] + v[:-1, :]) for v in velocity))
    largest = max(float(x_tensor[0].max()), float(z_tensor[1].max()))
    fastest = 8.0 * largest * (1.0 / mesh.hx**2 + 1.0 / mesh.hz**2)
    return (
        across_x * x_tensor[0] / mesh.hx,
        across_x * x_tensor[2] / mesh.hz,
        across_z * z_tensor[1] / mesh.hz,
        across_z * z_tensor[2] / mesh.hx,
    ), fastest


def _tensor(
    spreading: Spreading, vx: FloatArray, vz: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the components (xx, zz, xz) of Scheidegger's tensor [m^2/s]."""
    speed = np.hypot(vx, vz)
    along = (spreading.longitudinal - spreading.transverse) / np.maximum(speed, 1e-30)
    isotropic = spreading.transverse * speed + spreading.diffusion
    return isotropic + along * vx * vx, isotropic + along * vz * vz, along * vx * vz


def _super_step(
    c: FloatArray,
    conductances: tuple[FloatArray, ...],
    mass: FloatArray,
    duration: float,
    fastest: float,
) -> FloatArray:
    """Return one RKL2 step (Meyer et al. 2014, eqs. 15-18); `fastest` bounds the spectrum [1/s]."""
    xx, xz, zz, zx = conductances
    stages = max(3, math.ceil(0.5 * (math.sqrt(9.0 + 8.0 * duration * fastest) - 1.0)))
    stages += 1 - stages % 2
    w1 = 4.0 / (stages * stages + stages - 2.0)
    b = [1.0 / 3.0] * 3
    b += [(j * j + j - 2.0) / (2.0 * j * (j + 1.0)) for j in range(3, stages + 1)]
    first, rate = np.empty_like(c), np.empty_like(c)
    _rate(c, xx, xz, zz, zx, mass, first)
    before, now = c, c + b[1] * w1 * duration * first
    for j in range(2, stages + 1):
        mu = (2.0 * j - 1.0) / j * b[j] / b[j - 1]
        nu = -(j - 1.0) / j * b[j] / b[j - 2]
        a = 1.0 - b[j - 1]
        _rate(now, xx, xz, zz, zx, mass, rate)
        now, before = (
            mu * now
            + nu * before
            + (1.0 - mu - nu) * c
            + mu * w1 * duration * rate
            - a * mu * w1 * duration * first,
            now,
        )
    return now
