"""Numbers that sum up a concentration map: how much tracer, where, how far."""

from collections.abc import Callable

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_solver.physics import Physics

PLUME_THRESHOLD = 0.05
"""A cell belongs to the plume from this concentration on."""


def tracer_volume(physics: Physics, concentration: FloatArray) -> float:
    """Return the volume of tracer stock that the rig holds, sorbed tracer included [m^3]."""
    return float(np.sum(physics.storage * concentration))


def plume_centroid_x(physics: Physics, concentration: FloatArray) -> float:
    """Return the distance of the tracer's centre of mass from the left side [m]; NaN without."""
    return _centroid(physics, concentration, physics.grid.x[None, :])


def plume_centroid_z(physics: Physics, concentration: FloatArray) -> float:
    """Return the height of the tracer's centre of mass [m]; NaN without tracer."""
    return _centroid(physics, concentration, physics.grid.z[:, None])


def plume_area(physics: Physics, concentration: FloatArray) -> float:
    """Return the area of all cells above PLUME_THRESHOLD [m^2]."""
    return float(np.count_nonzero(concentration > PLUME_THRESHOLD) * physics.grid.cell_area)


def max_concentration(physics: Physics, concentration: FloatArray) -> float:  # noqa: ARG001
    """Return the largest concentration."""
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
    """Return the quantity `name` of a map (nz, nx).

    Raises:
        InputError: no such quantity; the message lists those there are.
    """
    if name not in QUANTITIES:
        raise InputError(f"quantity '{name}': unknown; choose from {', '.join(QUANTITIES)}")
    return QUANTITIES[name][1](physics, concentration)
