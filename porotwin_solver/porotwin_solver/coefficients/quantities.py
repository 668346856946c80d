"""Quantities of interest of a concentration map, such as the tracer volume and the centroid.

The argument `concentration` is a map (nz, nx) [-] without NaN.
"""

from collections.abc import Callable

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_solver.coefficients.physics import Physics


def tracer_volume(physics: Physics, concentration: FloatArray) -> float:
    """Return the tracer stock [m^3] of a map (nz, nx), sorbed tracer included: sum(c storage)."""
    return float(np.sum(physics.storage * concentration))


def plume_centroid_x(physics: Physics, concentration: FloatArray) -> float:
    """Return x of the tracer's centroid [m] for a map (nz, nx); NaN without tracer."""
    return _centroid(physics, concentration, physics.grid.x[None, :])


def plume_centroid_z(physics: Physics, concentration: FloatArray) -> float:
    """Return z of the tracer's centroid [m] for a map (nz, nx); NaN without tracer."""
    return _centroid(physics, concentration, physics.grid.z[:, None])


def plume_area(physics: Physics, concentration: FloatArray) -> float:
    """Return the area [m^2] of the cells of a map (nz, nx) above PLUME_THRESHOLD."""
    return float(np.count_nonzero(concentration > PLUME_THRESHOLD) * physics.grid.cell_area)


def max_concentration(physics: Physics, concentration: FloatArray) -> float:  # noqa: ARG001
    """Return the largest concentration [-] of a map (nz, nx)."""
    return float(concentration.max())


def _centroid(physics: Physics, concentration: FloatArray, position: FloatArray) -> float:
    weight = physics.storage * concentration
    total = weight.sum()
    return float((weight * position).sum() / total) if total > 0 else float('nan')


QUANTITIES: dict[str, tuple[str, Callable[[Physics, FloatArray], float]]] = {
    'tracer_volume': ('m^3', tracer_volume),
    'plume_centroid_x': ('m', plume_centroid_x),
    'plume_centroid_z': ('m', plume_centroid_z),
    'plume_area': ('m^2', plume_area),
    'max_concentration': ('1', max_concentration),
}
"""Every quantity of interest by name: its unit and its function."""


def quantity_of_interest(name: str, physics: Physics, concentration: FloatArray) -> float:
    """Return the quantity `name` of a map (nz, nx), in its SI unit (see QUANTITIES).

    Raises:
        InputError: there is no such quantity; the message lists the known ones.
    """
    if name not in QUANTITIES:
        raise InputError(f"quantity '{name}': unknown; choose from {', '.join(QUANTITIES)}")
    return QUANTITIES[name][1](physics, concentration)
