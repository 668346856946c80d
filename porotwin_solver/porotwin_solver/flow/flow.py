"""Incompressible Darcy flow by two-point flux finite volumes (paper eq. flow).

    q = -k/mu grad p,    div(d q) = f        d: depth of the rig

(Aziz and Settari, Petroleum Reservoir Simulation, ch. 4.) The pressure is solved once for a unit
rate of every well. Other rates are a superposition of these unit flows.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_solver.coefficients.discs import disc_fractions
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import SourceSink
from porotwin_solver.coefficients.water_contact import WaterContact
from porotwin_solver.flow.multigrid import GridLevel, Solve
from porotwin_solver.flow.pressure import Pressures

REMEMBERED_CELLS = 300_000
"""Cells of all remembered flows together; a factor takes about 1 kB per cell, so 300 MB."""

MOST_STRAY = 1e-11
"""Imbalance [m^3/s] of a cell in a unit flow above which its iteration is not good enough.
Round-off makes 1e-14; behind a wall a trillion times tighter than the sand, it left 1e-9."""

UNIT_FLOWS_KEPT = 16
"""Sources and sinks whose unit flow is kept; each takes 16 B per cell."""


def transmissibilities(
    grid: Grid, mobility_thickness: FloatArray, contact: WaterContact
) -> FaceField:
    """Return the two-point transmissibility of every face [m^3/(s Pa)].

    `mobility_thickness` (nz, nx) is d k / mu [m^3/(Pa s)]. The harmonic mean joins neighbours. A
    face to open water sees half a cell of sand; a face that is closed, or lies in open water, has
    transmissibility zero.
    """
    half_x = 2.0 * mobility_thickness * grid.dz / grid.dx
    half_z = 2.0 * mobility_thickness * grid.dx / grid.dz
    faces = FaceField.zeros(grid)
    faces.x[:, 1:-1] = half_x[:, :-1] * half_x[:, 1:] / (half_x[:, :-1] + half_x[:, 1:])
    faces.z[1:-1] = half_z[:-1] * half_z[1:] / (half_z[:-1] + half_z[1:])
    faces.x[:, 0] = half_x[:, 0] * contact.open.left
    faces.x[:, -1] = half_x[:, -1] * contact.open.right
    faces.z[0] = half_z[0] * contact.open.bottom
    faces.z[-1] = half_z[-1] * contact.open.top
    if contact.canal is not None:
        _border(faces.x, half_x, contact.canal)
        _border(faces.z.T, half_z.T, contact.canal.T)
    return faces if contact.scale is None else faces * contact.scale


def _border(faces: FloatArray, half: FloatArray, canal: NDArray[np.bool_]) -> None:
    """Set the transmissibility of the `faces` (rows, columns + 1) of open water in place.

    `half` (rows, columns) is the one of half a cell [m^3/(s Pa)].
    """
    one, other = canal[:, :-1], canal[:, 1:]
    sand = np.where(one, half[:, 1:], half[:, :-1])
    faces[:, 1:-1] = np.where(one | other, np.where(one & other, 0.0, sand), faces[:, 1:-1])
    faces[:, [0, -1]] = np.where(canal[:, [0, -1]], 0.0, faces[:, [0, -1]])


def transmissibilities_adjoint(
    grid: Grid,
    mobility_thickness: FloatArray,
    trans: FaceField,
    bar: FaceField,
    contact: WaterContact,
) -> FloatArray:
    """Return dJ/d(mobility_thickness), (nz, nx), of a cost J with `bar` = dJ/dtrans.

    For T = a b / (a + b) of two half cells, dT/da = (T / a)^2. To open water, T is a share of a.
    """
    if (scale := contact.scale) is not None:
        contact, bar = replace(contact, scale=None), bar * scale
        trans = transmissibilities(grid, mobility_thickness, contact)
    half_x = 2.0 * mobility_thickness * grid.dz / grid.dx
    half_z = 2.0 * mobility_thickness * grid.dx / grid.dz
    west, east = (trans.x[:, :-1] / half_x) ** 2, (trans.x[:, 1:] / half_x) ** 2
    south, north = (trans.z[:-1] / half_z) ** 2, (trans.z[1:] / half_z) ** 2
    # the square of a share is not the share
    west[:, 0], east[:, -1] = contact.open.left, contact.open.right
    south[0], north[-1] = contact.open.bottom, contact.open.top
    by_x = bar.x[:, :-1] * west + bar.x[:, 1:] * east
    by_z = bar.z[:-1] * south + bar.z[1:] * north
    found: FloatArray = (by_x * half_x + by_z * half_z) / mobility_thickness
    return contact.where_canal(found, np.zeros(grid.shape))


def pressure_flux(pressure: FloatArray, trans: FaceField) -> FaceField:
    """Return -T grad p [m^3/s] on every face, for `pressure` (nz, nx) [Pa], zero beyond sides."""
    nz, nx = pressure.shape
    drop = FaceField(np.zeros((nz, nx + 1)), np.zeros((nz + 1, nx)))
    np.subtract(pressure[:, :-1], pressure[:, 1:], out=drop.x[:, 1:-1])
    np.subtract(pressure[:-1], pressure[1:], out=drop.z[1:-1])
    drop.x[:, 0], drop.x[:, -1] = -pressure[:, 0], pressure[:, -1]
    drop.z[0], drop.z[-1] = -pressure[0], pressure[-1]
    return drop * trans


class Flow:
    """The flow for one field of coefficients, solved for any sources.

    Water at the sand has the potential zero. In a rig without any, the caller makes sure that the
    sources add up to zero; the flux then does not depend on the pinned pressure.
    """

    def __init__(
        self,
        grid: Grid,
        mobility_thickness: FloatArray,
        contact: WaterContact,
        *,
        make_pressures: Callable[[GridLevel], Pressures] = Pressures,
    ) -> None:
        """Prepare the pressures of `mobility_thickness` = d k / mu [m^3/(Pa s)], (nz, nx)."""
        self.grid = grid
        self.transmissibility = transmissibilities(grid, mobility_thickness, contact)
        self.closed, self.canal = contact.closed, contact.canal
        trans = self.transmissibility
        # any transmissibility will do; one column has none along x, one cell none at all
        self.pin = float(trans.x.max() or trans.z.max() or 1.0) if self.closed else 0.0
        self._pressures = make_pressures(GridLevel.of(trans, pin=self.pin, canal=self.canal))
        # not lru_cache on a method: it would keep a discarded flow and its factor alive
        self._unit_fluxes: OrderedDict[SourceSink, FaceField] = OrderedDict()
        self._lock = Lock()

    def unit_flux(self, source_sink: SourceSink) -> FaceField:
        """Return the flux [m^3/s] of 1 m^3/s into `source_sink`; the latest few are kept.

        Raises:
            InputError: the source or sink lies outside the rig.
        """
        with self._lock:
            flux = self._unit_fluxes.get(source_sink)
        if flux is None:
            cells, fractions = disc_fractions(
                self.grid, source_sink.x, source_sink.z, source_sink.radius
            )
            source = np.zeros(self.grid.shape)
            source.ravel()[cells] = fractions
            flux = self._balanced(source, FaceField.zeros(self.grid), self._pressures.solve_once)
            if np.abs(self._imbalance(source, flux)).max() > MOST_STRAY:
                flux = self.flux(source)
        with self._lock:
            self._unit_fluxes[source_sink] = flux
            self._unit_fluxes.move_to_end(source_sink)
            if len(self._unit_fluxes) > UNIT_FLOWS_KEPT:
                self._unit_fluxes.popitem(last=False)
        return flux

    def flux(self, source: FloatArray, driven: FaceField | None = None) -> FaceField:
        """Return the flux [m^3/s] through every face.

        `source` (nz, nx) [m^3/s] is injected into the cells. `driven` is a flux without pressure
        gradient, such as the buoyant one; the result includes it.

        Raises:
            InputError: the iterative solver for large grids does not converge.
        """
        driven = FaceField.zeros(self.grid) if driven is None else driven
        return self._balanced(source, driven, self._pressures.solve)

    def solve(self, source: FloatArray) -> FloatArray:
        """Return the pressure [Pa] for `source` [m^3/s], both flat (nz * nx,); see `Pressures`.

        Raises:
            InputError: as `flux`.
        """
        return self._pressures.solve(source)

    def _imbalance(self, source: FloatArray, flux: FaceField) -> FloatArray:
        """Return the part of `source` that `flux` does not carry out of each cell [m^3/s].

        In a closed rig the pinned cell takes the net rate of the sources. Canals take any water.
        """
        imbalance = source - flux.divergence()
        if self.canal is not None:
            imbalance[self.canal] = 0.0
        if self.closed:
            imbalance[0, 0] -= imbalance.sum()
        return imbalance

    def without_divergence(self, flux: FaceField) -> FaceField:
        """Return `flux` [m^3/s], of little divergence, and the flux that removes the divergence.

        Raises:
            InputError: as `flux`.
        """
        source = np.zeros(self.grid.shape)
        return self._balanced(source, flux, self._pressures.solve, solutions=1)

    def _balanced(
        self, source: FloatArray, flux: FaceField, solve: Solve, *, solutions: int = 2
    ) -> FaceField:
        """Return `flux` and the pressure-driven flux that gives it the divergence `source`.

        Each of the `solutions` removes the divergence that round-off left.
        """
        for _ in range(solutions):
            imbalance = self._imbalance(source, flux)
            pressure = solve(imbalance.ravel()).reshape(self.grid.shape)
            flux = flux + pressure_flux(pressure, self.transmissibility)
        return flux


class FlowCache:
    """The flows used last, for models of one rig that share their flow.

    Many models differ in the porosity or the pumps only, and a solution of the flow takes a good
    part of a simulation.
    """

    def __init__(self, *, max_cells: int) -> None:
        """Keep flows that have at most `max_cells` cells together."""
        self._max_cells = max_cells
        self._flows: OrderedDict[tuple[object, ...], Flow] = OrderedDict()
        self._cells = 0
        self._lock = Lock()

    def flow(self, grid: Grid, mobility_thickness: FloatArray, contact: WaterContact) -> Flow:
        """Return the `Flow` of exactly these coefficients, a kept one where there is one."""
        key = (grid, contact.key, mobility_thickness.tobytes())
        with self._lock:
            if key in self._flows:
                self._flows.move_to_end(key)
                return self._flows[key]
        flow = Flow(grid, mobility_thickness, contact)
        with self._lock:
            if key not in self._flows:  # another thread may have been faster
                self._cells += grid.nx * grid.nz
            self._flows[key] = flow
            while self._cells > self._max_cells:
                _, oldest = self._flows.popitem(last=False)
                self._cells -= oldest.grid.nx * oldest.grid.nz
        return flow


SHARED_FLOWS = FlowCache(max_cells=REMEMBERED_CELLS)
"""The flows that all models of this process share."""
