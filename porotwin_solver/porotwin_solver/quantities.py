"""Quantities of interest of a concentration map, such as the tracer volume and the centroid."""

from collections.abc import Callable

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_solver.physics import Physics

PLUME_THRESHOLD = 0.05
"""Concentration [-] above which a cell belongs to the plume: above the usual noise of a map."""


def tracer_volume(physics: Physics, concentration: FloatArray) -> float:
    """Return the volume of tracer stock in the rig [m^3], sorbed tracer included."""
    return float(np.sum(physics.storage * concentration))


def plume_centroid_x(physics: Physics, concentration: FloatArray) -> float:
    """Return the distance of the tracer's centroid from the left side [m]; NaN without tracer."""
    return _centroid(physics, concentration, physics.grid.x[None, :])


def plume_centroid_z(physics: Physics, concentration: FloatArray) -> float:
    """Return the height of the tracer's centroid above the bottom [m]; NaN without tracer."""
    return _centroid(physics, concentration, physics.grid.z[:, None])


def plume_area(physics: Physics, concentration: FloatArray) -> float:
    """Return the area of all cells above PLUME_THRESHOLD, in the plane of the rig [m^2]."""
    return float(np.count_nonzero(concentration > PLUME_THRESHOLD) * physics.grid.cell_area)


def max_concentration(physics: Physics, concentration: FloatArray) -> float:  # noqa: ARG001
    """Return the largest concentration [-]."""
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
