"""Incompressible Darcy flow by two-point flux finite volumes (paper eq. flow).

    q = -k/mu grad p,    div(d q) = f        d: depth of the rig

The pressure of every well, at unit rate, is solved once; a change of rates is a superposition.
"""

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import numpy as np
from scipy.sparse import csc_matrix, diags_array

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Boundaries
from porotwin_solver.discs import disc_shares
from porotwin_solver.physics import SourceSink
from porotwin_solver.pressure import PressureSolver, pressure_solver

REMEMBERED_CELLS = 300_000
"""Cells of all flows together that are remembered; a factor takes about 1 kB per cell."""

UNITS_KEPT = 16
"""SourcesAndSinks whose unit flow is kept; each takes 16 B per cell."""

_lock = Lock()


@dataclass(frozen=True)
class FaceField:
    """One number per face: `x` (nz, nx + 1) on upright faces, `z` (nz + 1, nx) on level ones.

    For fluxes: volume per time [m^3/s], positive to the right and upward.
    """

    x: FloatArray
    z: FloatArray

    @classmethod
    def zeros(cls, grid: Grid) -> 'FaceField':
        """Return the field that is zero on every face of `grid`."""
        return cls(np.zeros((grid.nz, grid.nx + 1)), np.zeros((grid.nz + 1, grid.nx)))

    def __add__(self, other: 'FaceField') -> 'FaceField':
        return FaceField(self.x + other.x, self.z + other.z)

    def __mul__(self, factor: 'float | FaceField') -> 'FaceField':
        if isinstance(factor, FaceField):
            return FaceField(self.x * factor.x, self.z * factor.z)
        return FaceField(self.x * factor, self.z * factor)

    def refined(self, factor: int) -> 'FaceField':
        """Return the flux through the faces of cells split into `factor` x `factor`.

        The velocity varies linearly from side to side of a cell (lowest Raviart-Thomas element), so
        the parts of a cell share its divergence equally.
        """
        if factor == 1:
            return self
        return FaceField(
            np.repeat(_interpolated(self.x.T, factor).T, factor, axis=0) / factor,
            np.repeat(_interpolated(self.z, factor), factor, axis=1) / factor,
        )

    def refined_adjoint(self, factor: int) -> 'FaceField':
        """Return the derivatives by the faces that `refined` turned into those of `self`."""
        if factor == 1:
            return self
        return FaceField(
            _interpolated_adjoint(_sums(self.x, factor).T, factor).T / factor,
            _interpolated_adjoint(_sums(self.z.T, factor).T, factor) / factor,
        )

    def divergence(self) -> FloatArray:
        """Return the net outflow of every cell, shape (nz, nx)."""
        return np.diff(self.x, axis=1) + np.diff(self.z, axis=0)


def _interpolated(rows: FloatArray, factor: int) -> FloatArray:
    """Return `rows` with `factor` - 1 rows between each two, linear in between."""
    parts = np.arange(factor)[:, None] / factor
    between = rows[:-1, None] * (1.0 - parts) + rows[1:, None] * parts
    return np.concatenate([between.reshape(-1, rows.shape[1]), rows[-1:]])


def _interpolated_adjoint(rows: FloatArray, factor: int) -> FloatArray:
    """Return the derivatives by the rows that `_interpolated` was given."""
    parts = np.arange(factor)[:, None] / factor
    between = rows[:-1].reshape(-1, factor, rows.shape[1])
    given = np.zeros((len(between) + 1, rows.shape[1]))
    given[:-1] += (between * (1.0 - parts)).sum(axis=1)
    given[1:] += (between * parts).sum(axis=1)
    given[-1] += rows[-1]
    return given


def _sums(rows: FloatArray, factor: int) -> FloatArray:
    """Return the sums of every `factor` rows."""
    return rows.reshape(-1, factor, rows.shape[1]).sum(axis=1)


def transmissibilities(grid: Grid, conductance: FloatArray, boundaries: Boundaries) -> FaceField:
    """Return the two-point transmissibility of every face [m^3/(s Pa)].

    `conductance` (nz, nx) is depth times mobility, d k / mu [m^3/(Pa s)]; neighbours are joined by
    the harmonic mean. Faces on an open side see half a cell, those on a closed side none.
    """
    half_x = 2.0 * conductance * grid.dz / grid.dx
    half_z = 2.0 * conductance * grid.dx / grid.dz
    faces = FaceField.zeros(grid)
    faces.x[:, 1:-1] = half_x[:, :-1] * half_x[:, 1:] / (half_x[:, :-1] + half_x[:, 1:])
    faces.z[1:-1] = half_z[:-1] * half_z[1:] / (half_z[:-1] + half_z[1:])
    if boundaries.left == 'open':
        faces.x[:, 0] = half_x[:, 0]
    if boundaries.right == 'open':
        faces.x[:, -1] = half_x[:, -1]
    if boundaries.bottom == 'open':
        faces.z[0] = half_z[0]
    if boundaries.top == 'open':
        faces.z[-1] = half_z[-1]
    return faces


def transmissibilities_adjoint(
    grid: Grid, conductance: FloatArray, trans: FaceField, bar: FaceField
) -> FloatArray:
    """Return the derivative by `conductance` of a cost with the derivatives `bar` by `trans`.

    T = a b / (a + b) of two half cells: dT/da = (T / a)^2; T = a on an open side.
    """
    half_x = 2.0 * conductance * grid.dz / grid.dx
    half_z = 2.0 * conductance * grid.dx / grid.dz
    by_x = bar.x[:, :-1] * (trans.x[:, :-1] / half_x) ** 2
    by_x += bar.x[:, 1:] * (trans.x[:, 1:] / half_x) ** 2
    by_z = bar.z[:-1] * (trans.z[:-1] / half_z) ** 2
    by_z += bar.z[1:] * (trans.z[1:] / half_z) ** 2
    return (by_x * half_x + by_z * half_z) / conductance


def pressure_matrix(faces: FaceField, *, pin: float) -> csc_matrix:
    """Return the symmetric positive definite two-point matrix of the pressures.

    `pin` is added to the first diagonal entry: a rig without an open side knows its pressure but
    for a constant, and with balanced sources that entry changes no flux.
    """
    nz, nx = faces.x.shape[0], faces.z.shape[1]
    diagonal = faces.x[:, :-1] + faces.x[:, 1:] + faces.z[:-1] + faces.z[1:]
    diagonal[0, 0] += pin
    right = faces.x[:, 1:].copy()
    right[:, -1] = 0.0
    right = right.ravel()[:-1]
    up = faces.z[1:-1].ravel()
    size = nx * nz
    if nx == 1 and nz == 1:
        return csc_matrix(diagonal.reshape(1, 1))
    if nx == 1 or nz == 1:
        line = right if nz == 1 else up
        return csc_matrix(diags_array([-line, diagonal.ravel(), -line], offsets=[-1, 0, 1]))
    return csc_matrix(
        diags_array(
            [-up, -right, diagonal.ravel(), -right, -up],
            offsets=[-nx, -1, 0, 1, nx],
            shape=(size, size),
        )
    )


class Flow:
    """The flow of one field of coefficients: factorised once, then asked for any sources.

    Open sides are at constant potential. In a rig whose sides are all closed, sources must add up
    to zero (the caller checks); the flux then does not depend on where the pressure is pinned.
    """

    def __init__(self, grid: Grid, conductance: FloatArray, boundaries: Boundaries) -> None:
        """Factorise the pressure matrix of `conductance` = d k / mu [m^3/(Pa s)], (nz, nx)."""
        self.grid = grid
        self.transmissibility = transmissibilities(grid, conductance, boundaries)
        self.closed = 'open' not in boundaries.model_dump().values()
        trans = self.transmissibility
        # any conductance does; a single column has none along x, a single cell none at all
        self.pin = float(trans.x.max() or trans.z.max() or 1.0) if self.closed else 0.0
        matrix = pressure_matrix(self.transmissibility, pin=self.pin)
        self.solve: PressureSolver = pressure_solver(matrix, grid.shape)
        # no cache that holds a method: a flow that is given up must go at once, with its factor
        self._units: OrderedDict[SourceSink, FaceField] = OrderedDict()

    def unit_flux(self, source_sink: SourceSink) -> FaceField:
        """Return the flux [m^3/s] that 1 m^3/s into `source_sink` drives; the last few are kept."""
        with _lock:
            flux = self._units.get(source_sink)
        if flux is None:
            cells, parts = disc_shares(self.grid, source_sink.x, source_sink.z, source_sink.radius)
            source = np.zeros(self.grid.shape)
            source.ravel()[cells] = parts
            flux = self.flux(source)
        with _lock:
            self._units[source_sink] = flux
            self._units.move_to_end(source_sink)
            if len(self._units) > UNITS_KEPT:
                self._units.popitem(last=False)
        return flux

    def flux(self, source: FloatArray, driven: FaceField | None = None) -> FaceField:
        """Return the flux [m^3/s] through every face.

        `source` (nz, nx) [m^3/s] is what enters the cells; `driven` is a flux that the faces carry
        beside that of the pressure gradient, such as that of buoyancy.
        """
        flux = FaceField.zeros(self.grid) if driven is None else driven
        # twice: the second solution takes away the round-off that the first leaves
        for _ in range(2):
            lacking = source - flux.divergence()
            pressure = self.solve(lacking.ravel()).reshape(self.grid.shape)
            flux = flux + self.pressure_flux(pressure, self.transmissibility)
        return flux

    def pressure_flux(self, pressure: FloatArray, trans: FaceField) -> FaceField:
        """Return -T grad p [m^3/s] on every face, the potential of open sides being zero."""
        flux = FaceField.zeros(self.grid)
        flux.x[:, 1:-1] = -np.diff(pressure, axis=1)
        flux.z[1:-1] = -np.diff(pressure, axis=0)
        flux.x[:, 0], flux.x[:, -1] = -pressure[:, 0], pressure[:, -1]
        flux.z[0], flux.z[-1] = -pressure[0], pressure[-1]
        return flux * trans


_remembered: OrderedDict[tuple[object, ...], Flow] = OrderedDict()


def flow_of(grid: Grid, conductance: FloatArray, boundaries: Boundaries) -> Flow:
    """Return the `Flow` of these coefficients, one of the last ones where they are the same.

    Many models of one rig differ in what leaves the flow as it is, the porosity or the pumps, and
    factorising takes as long as a good part of a run.
    """
    key = (grid, *boundaries.model_dump().values(), conductance.tobytes())
    with _lock:
        if key in _remembered:
            _remembered.move_to_end(key)
            return _remembered[key]
    flow = Flow(grid, conductance, boundaries)
    with _lock:
        _remembered[key] = flow
        cells = sum(known.grid.nx * known.grid.nz for known in _remembered.values())
        while cells > REMEMBERED_CELLS:
            _, oldest = _remembered.popitem(last=False)
            cells -= oldest.grid.nx * oldest.grid.nz
    return flow
