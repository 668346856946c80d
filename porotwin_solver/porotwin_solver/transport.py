"""Advection of the tracer: conservative, bounded, sharp at fronts, every cell at its own pace.

    phi dc/dt + div(q c) = f_c        (paper eq. transport)

Space and time are discretised together, unsplit. The value that leaves cell i through a face is

    c_f = c_i + correction,    correction = limited slope + transverse part (corner transport)

- limited slope: Lax-Wendroff with the superbee limiter, or the third-order QUICKEST value kept
  within the superbee region (LeVeque, Finite Volume Methods for Hyperbolic Problems, sec. 6.11;
  Leonard, Comput. Methods Appl. Mech. Eng. 88 (1991) 17-74); zero for first-order upwind;
- transverse part: what enters through the cell's other sides during half a step (Colella, J.
  Comput. Phys. 87 (1990) 171-200; LeVeque, sec. 20.5);
- bounds: c_f lies between the two cells of its face, and the corrections of one cell together are
  scaled such that the cell stays within the range of itself, its upstream neighbours and what is
  injected, in the manner of Zalesak, J. Comput. Phys. 31 (1979) 335-362. No value is ever clipped.

Local time steps: a cell of level l takes 2^l steps of dt / 2^l, so that what leaves it in one step
is at most COURANT of its pore volume. A face is evaluated at the pace of its upstream cell, and
what it carries is booked to both sides: conservative to round-off. The cost grows with the sum of
the cells' Courant numbers, not with the largest one, which sits at a well.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.grid import FloatArray
from porotwin_solver.compiled import NO_TAPE
from porotwin_solver.flow import FaceField
from porotwin_solver.transport_kernels import advection, paces

COURANT = 0.5
"""Largest share of a cell's pore volume that may leave it within one of its steps."""

UPWIND, SUPERBEE, THIRD_ORDER = 0, 1, 2
"""Schemes for the value on a face; the last two differ in how smooth slopes are treated."""


class Sources(NamedTuple):
    """What enters and leaves the cells beside their faces; each (nz, nx) [m^3/s], not negative.

    `inflow` is water that is injected, `tracer` the stock that comes with it (inflow times its
    concentration), `outflow` the water that is taken out at the cell's own concentration.
    """

    inflow: FloatArray
    tracer: FloatArray
    outflow: FloatArray

    @property
    def net(self) -> FloatArray:
        """What the sources add to each cell's water [m^3/s]."""
        return self.inflow - self.outflow


class Pace(NamedTuple):
    """The steps that the cells take within `time_step` [s].

    `level` (nz, nx): the cell takes 2**level steps. `order`: flat indices of the cells, the highest
    level first; `reach[l]`: how many of them have level l or higher.
    """

    time_step: float
    level: NDArray[np.int8]
    order: NDArray[np.int32]
    reach: NDArray[np.int64]


def pace(flux: FaceField, sources: Sources, pore_volume: FloatArray, time_step: float) -> Pace:
    """Return the local time steps for `flux` and `sources` over `time_step` [s].

    `pore_volume` (nz, nx) [m^3] is what stores tracer: porosity times rig volume of the cell, times
    the retardation factor.
    """
    level, order, reach = paces(
        flux.x, flux.z, sources.inflow, sources.outflow, pore_volume, time_step, COURANT
    )
    return Pace(time_step, level, order, reach)


class Carried(NamedTuple):
    """Scratch of one advection: per face the tracer carried per time, and the amount in transit."""

    rate: FaceField
    amount: FaceField

    @classmethod
    def zeros(cls, flux: FaceField) -> 'Carried':
        """Return scratch for the faces of `flux`."""
        return cls(
            FaceField(np.zeros_like(flux.x), np.zeros_like(flux.z)),
            FaceField(np.zeros_like(flux.x), np.zeros_like(flux.z)),
        )


def advect(
    concentration: FloatArray,
    flux: FaceField,
    *,
    sources: Sources,
    pore_volume: FloatArray,
    steps: Pace,
    scheme: int,
    scratch: Carried | None = None,
    left: FloatArray | None = None,
    tape: FloatArray | None = None,
) -> None:
    """Advance `concentration` (nz, nx) in place by `steps.time_step`.

    The divergence of `flux` must equal `sources.net`; then a constant state stays constant and all
    states stay within the range of the initial and the injected ones. Through open sides comes
    water without tracer. `tape` of `tape_length(steps.reach)` records what the adjoint needs.
    To `left` is added the tracer [m^3] that left through wells, leaks and through open sides.
    """
    carried = Carried.zeros(flux) if scratch is None else scratch
    advection(
        concentration,
        flux.x,
        flux.z,
        sources.inflow,
        sources.tracer,
        sources.outflow,
        pore_volume,
        steps.time_step,
        steps.level,
        steps.order,
        steps.reach,
        scheme,
        carried.rate.x,
        carried.rate.z,
        carried.amount.x,
        carried.amount.z,
        np.zeros(2) if left is None else left,
        NO_TAPE if tape is None else tape,
    )
