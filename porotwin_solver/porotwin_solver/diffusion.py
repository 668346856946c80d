"""Diffusion of the tracer: d(phi c)/dt = div(phi D grad c), explicit, conservative, bounded."""

import math

import numpy as np
from porotwin_core.grid import FloatArray
from porotwin_solver.physics import Physics
from porotwin_solver.transport import compiled


def diffuse(concentration: FloatArray, physics: Physics, duration: float) -> None:
    coefficient = physics.diffusion + physics.model_diffusion
    if coefficient == 0.0:
        return
    grid = physics.grid
    w = physics.volume * physics.porosity * coefficient
    limit = 0.5 / (2 * coefficient * (1 / grid.dx**2 + 1 / grid.dz**2))
    count = max(1, math.ceil(duration / limit))
    for _ in range(count):
        concentration += (
            _explicit(concentration, w, grid.dx, grid.dz) * (duration / count) / physics.storage
        )


@compiled
def _explicit(c, w, dx, dz):  # type: ignore[no-untyped-def]
    nz, nx = c.shape
    out = np.zeros((nz, nx))
    for i in range(nz):
        for j in range(nx):
            if j < nx - 1:
                g = (c[i, j + 1] - c[i, j]) * 0.5 * (w[i, j] + w[i, j + 1]) / dx**2
                out[i, j] += g
                out[i, j + 1] -= g
            if i < nz - 1:
                g = (c[i + 1, j] - c[i, j]) * 0.5 * (w[i, j] + w[i + 1, j]) / dz**2
                out[i, j] += g
                out[i + 1, j] -= g
    return out
