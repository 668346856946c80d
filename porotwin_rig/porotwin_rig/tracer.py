"""The tracer in the virtual rig, and its balance."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]


class Tracer(NamedTuple):
    """The tracer at the vertices of the mesh, (nz + 1, nx + 1) [-] each.

    `mobile` is the concentration of the mobile water. `stationary` is the tracer in immobile water
    or on the sand, per pore volume.
    """

    mobile: FloatArray
    stationary: FloatArray


@dataclass(frozen=True)
class TracerBalance:
    """Volumes of tracer stock since the start [m^3].

    Args:
        injected: injected through the wells.
        removed: taken out by wells and leaks, or lost through open sides.
        decayed: lost by reactions.
        corrected: sum of the absolute corrections that conserve the mass of every step.
    """

    injected: float = 0.0
    removed: float = 0.0
    decayed: float = 0.0
    corrected: float = 0.0
