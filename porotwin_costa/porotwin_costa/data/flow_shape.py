"""The flow of each well through homogeneous sand: the input that the local network gets for rates.

COSTA never calls a solver. But numerical diffusion, and most other errors of a transport model,
follow the flow, and the flow follows the rates. In homogeneous sand the potential of a well depends
on the geometry alone, so it is known without a solver. The network learns the effect of other sand.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Boundaries, Rig


@dataclass(frozen=True)
class FlowShape:
    """Flow through the inner faces per unit well rate [-].

    `right` has shape (wells, nz, nx - 1) and is positive to the right; `up` has shape
    (wells, nz - 1, nx) and is positive upward. The caller chooses the order of the wells.
    """

    right: FloatArray
    up: FloatArray


_TRANSFORMS = {
    # sides (low, high): family and type of the transform whose basis satisfies them, and its shift
    ('closed', 'closed'): ('cosine', 2, 0.0),
    ('open', 'open'): ('sine', 2, 1.0),
    ('closed', 'open'): ('cosine', 4, 0.5),
    ('open', 'closed'): ('sine', 4, 0.5),
}


def _transform(
    values: FloatArray, axis: int, sides: tuple[str, str], *, inverse: bool
) -> FloatArray:
    from scipy import fft  # takes a third of the start of a node without a model

    family, kind, _ = _TRANSFORMS[sides]
    function = {
        ('cosine', False): fft.dct,
        ('cosine', True): fft.idct,
        ('sine', False): fft.dst,
        ('sine', True): fft.idst,
    }[family, inverse]
    return np.asarray(function(values, type=kind, axis=axis, norm='ortho'))


def _eigenvalues(count: int, sides: tuple[str, str]) -> FloatArray:
    """Return the eigenvalues of -u[i-1] + 2 u[i] - u[i+1] on `count` cells with these sides."""
    shift = _TRANSFORMS[sides][2]
    return 2.0 - 2.0 * np.cos(np.pi * (np.arange(count) + shift) / count)


def homogeneous_flow(
    grid: Grid, wells: Mapping[str, tuple[float, float]], boundaries: Boundaries
) -> FlowShape:
    """Return the flow of each well at (x, z) [m] through homogeneous sand, if it pumps alone.

    The five-point Laplace equation with a point source is solved exactly by cosine and sine
    transforms (Strang, "The discrete cosine transform", SIAM Review 41(1), 1999). The flux through
    a closed side is zero; the potential at an open side is constant. If all sides are closed, the
    injected water is withdrawn evenly from the whole rig. The superposition is still exact for
    rates that sum to zero.
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
    """Return `homogeneous_flow` for the named wells of a rig, in the order of `wells`."""
    places = {name: (rig.wells[name].x_m, rig.wells[name].z_m) for name in wells}
    return homogeneous_flow(grid, places, rig.boundaries)
