"""How water would flow from each well through even sand: what the local network sees of the rates.

COSTA never asks a solver. But numerical diffusion and most other errors of a transport model follow
the flow, and the flow follows the rates. In homogeneous sand the potential of a well is known from
geometry alone, so the network can be told where the water goes; what the real sand does
differently is left for it to learn.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.fft

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Boundaries, Rig


@dataclass(frozen=True)
class FlowShape:
    """Flow per unit well rate through the inner faces, as shares of what the well injects [-].

    `right` has shape (wells, nz, nx - 1), positive to the right; `up` (wells, nz - 1, nx), upward.
    The order of the wells is the caller's.
    """

    right: FloatArray
    up: FloatArray


_TRANSFORMS = {
    # sides (low, high): type and kind of the transform whose basis obeys them, and its wave shift
    ('closed', 'closed'): ('cosine', 2, 0.0),
    ('open', 'open'): ('sine', 2, 1.0),
    ('closed', 'open'): ('cosine', 4, 0.5),
    ('open', 'closed'): ('sine', 4, 0.5),
}


def _transform(
    values: FloatArray, axis: int, sides: tuple[str, str], *, inverse: bool
) -> FloatArray:
    family, kind, _ = _TRANSFORMS[sides]
    function = {
        ('cosine', False): scipy.fft.dct,
        ('cosine', True): scipy.fft.idct,
        ('sine', False): scipy.fft.dst,
        ('sine', True): scipy.fft.idst,
    }[family, inverse]
    return np.asarray(function(values, type=kind, axis=axis, norm='ortho'))


def _eigenvalues(count: int, sides: tuple[str, str]) -> FloatArray:
    """Return those of the second difference -u[i-1] + 2 u[i] - u[i+1] on cells with these sides."""
    shift = _TRANSFORMS[sides][2]
    return 2.0 - 2.0 * np.cos(np.pi * (np.arange(count) + shift) / count)


def homogeneous_flow(
    grid: Grid, wells: Mapping[str, tuple[float, float]], boundaries: Boundaries
) -> FlowShape:
    """Return the flow of each well at (x, z) [m] alone through homogeneous sand.

    Five-point Laplace equation with a point source, solved exactly by cosine and sine transforms
    (Strang, "The discrete cosine transform", SIAM Review 41(1), 1999). Closed sides let nothing
    through, open ones hold the potential. If all sides are closed the missing outflow is taken
    evenly from the whole rig; for rates that sum to zero, superposition is exact all the same.
    """
    vertical = (boundaries.bottom, boundaries.top)
    horizontal = (boundaries.left, boundaries.right)
    stiffness = (
        _eigenvalues(grid.nz, vertical)[:, None] * grid.dx / grid.dz
        + _eigenvalues(grid.nx, horizontal)[None, :] * grid.dz / grid.dx
    )
    with np.errstate(divide='ignore'):
        inverse = np.where(stiffness > 0, 1.0 / stiffness, 0.0)
    right, up = [], []
    for x, z in wells.values():
        source = np.zeros(grid.shape)
        source[min(int(z / grid.dz), grid.nz - 1), min(int(x / grid.dx), grid.nx - 1)] = 1.0
        waves = _transform(
            _transform(source, 0, vertical, inverse=False), 1, horizontal, inverse=False
        )
        potential = _transform(
            _transform(waves * inverse, 0, vertical, inverse=True), 1, horizontal, inverse=True
        )
        right.append(-np.diff(potential, axis=1) * grid.dz / grid.dx)
        up.append(-np.diff(potential, axis=0) * grid.dx / grid.dz)
    return FlowShape(
        np.array(right).reshape(len(wells), grid.nz, grid.nx - 1),
        np.array(up).reshape(len(wells), grid.nz - 1, grid.nx),
    )


def flow_shape_of(rig: Rig, grid: Grid, wells: tuple[str, ...]) -> FlowShape:
    """Return `homogeneous_flow` for the named wells of a rig, in this order."""
    places = {name: (rig.wells[name].x_m, rig.wells[name].z_m) for name in wells}
    return homogeneous_flow(grid, places, rig.boundaries)
