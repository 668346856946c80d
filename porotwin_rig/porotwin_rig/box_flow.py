"""Darcy flow of the virtual rig: vertex-centred box method with analytic wells.

The unknown is the potential h [m] at the vertices of bilinear elements. Water is balanced over the
box around every vertex (control-volume finite elements; Baliga & Patankar 1980; Bank & Rose 1987).
The potential of a well is singular. Its singular part, h_w = -Q ln(r) / (2 pi T_w), is analytic.
Only the smooth remainder is computed, so a well keeps its exact place within a cell.
"""

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_rig.mesh import Mesh

FloatArray = NDArray[np.floating]
Solve = Callable[[FloatArray], FloatArray]

MOST_ITERATIONS = 1000
"""Iterations of conjugate gradients; enough for viscosity ratios from 1 / 1000 to 1000."""

TOLERANCE = 1e-8
"""Relative residual at which conjugate gradients stop; far below the error of the mesh."""

RELATIVE = 'rtol' if 'rtol' in inspect.signature(cg).parameters else 'tol'
"""Name of the tolerance: SciPy renamed it in 1.12."""


@dataclass(frozen=True)
class Fluxes:
    """Fluxes through the faces of the boxes around the vertices [m^3/s], positive along x and z.

    Args:
        x: fluxes along x, (nz + 1, nx + 2); the first and last column are the walls.
        z: fluxes along z, (nz + 2, nx + 1); the first and last row are the walls.
    """

    x: FloatArray
    z: FloatArray

    def __add__(self, other: 'Fluxes') -> 'Fluxes':
        return Fluxes(self.x + other.x, self.z + other.z)

    def __sub__(self, other: 'Fluxes') -> 'Fluxes':
        return Fluxes(self.x - other.x, self.z - other.z)

    def __mul__(self, factor: float) -> 'Fluxes':
        return Fluxes(self.x * factor, self.z * factor)

    @property
    def outflow(self) -> FloatArray:
        """Net outflow of every box [m^3/s], shape (nz + 1, nx + 1)."""
        return np.diff(self.x, axis=1) + np.diff(self.z, axis=0)


def no_flux(mesh: Mesh) -> Fluxes:
    """Return zero fluxes on `mesh`."""
    rows, columns = mesh.shape
    return Fluxes(np.zeros((rows, columns + 1)), np.zeros((rows + 1, columns)))


@dataclass(frozen=True)
class HalfFaces:
    """Fluxes through the four half faces inside every element [m^3/s], each (nz, nx).

    Args:
        low: along x, through the lower half of the vertical middle line.
        high: along x, through its upper half.
        left: along z, through the left half of the horizontal middle line.
        right: along z, through its right half.
    """

    low: FloatArray
    high: FloatArray
    left: FloatArray
    right: FloatArray

    def scaled(self, along_x: FloatArray, along_z: FloatArray) -> 'HalfFaces':
        """Return the fluxes times factors of the elements along x and along z, (nz, nx)."""
        return HalfFaces(
            self.low * along_x, self.high * along_x, self.left * along_z, self.right * along_z
        )

    def onto_boxes(self, mesh: Mesh) -> Fluxes:
        """Return the fluxes through whole faces of boxes; those through the walls are zero."""
        fluxes = no_flux(mesh)
        fluxes.x[:-1, 1:-1] += self.low
        fluxes.x[1:, 1:-1] += self.high
        fluxes.z[1:-1, :-1] += self.left
        fluxes.z[1:-1, 1:] += self.right
        return fluxes


def bilinear_flow(
    mesh: Mesh, potential: FloatArray, along_x: FloatArray, along_z: FloatArray
) -> HalfFaces:
    """Return the Darcy fluxes through the half faces for a bilinear potential.

    Args:
        mesh: the mesh.
        potential: at the vertices [m], (nz + 1, nx + 1).
        along_x: transmissivity K * depth of the elements along x [m^2/s], (nz, nx).
        along_z: the same along z.
    """
    h00, h10 = potential[:-1, :-1], potential[:-1, 1:]
    h01, h11 = potential[1:, :-1], potential[1:, 1:]
    ax = along_x * (0.5 * mesh.hz / mesh.hx)
    az = along_z * (0.5 * mesh.hx / mesh.hz)
    lower, upper, left, right = h00 - h10, h01 - h11, h00 - h01, h10 - h11
    return HalfFaces(
        low=ax * (0.75 * lower + 0.25 * upper),
        high=ax * (0.25 * lower + 0.75 * upper),
        left=az * (0.75 * left + 0.25 * right),
        right=az * (0.25 * left + 0.75 * right),
    )


def _angle(ax: FloatArray, az: FloatArray, bx: FloatArray, bz: FloatArray) -> FloatArray:
    """Return the angle from the ray (ax, az) to the ray (bx, bz), counter-clockwise positive."""
    return np.arctan2(ax * bz - az * bx, ax * bx + az * bz)


def radial_half_faces(mesh: Mesh, x: float, z: float) -> HalfFaces:
    """Return the half-face fluxes of a unit source at (x, z) [m] in an unbounded plane.

    The flux through a segment is proportional to the angle that it subtends at the source.
    """
    left, bottom = mesh.x[None, :-1] - x, mesh.z[:-1, None] - z
    middle_x, middle_z = left + 0.5 * mesh.hx, bottom + 0.5 * mesh.hz
    right, top = left + mesh.hx, bottom + mesh.hz
    share = 1.0 / (2.0 * math.pi)
    return HalfFaces(
        low=share * _angle(middle_x, bottom, middle_x, middle_z),
        high=share * _angle(middle_x, middle_z, middle_x, top),
        left=share * _angle(middle_x, middle_z, left, middle_z),
        right=share * _angle(right, middle_z, middle_x, middle_z),
    )


def radial_fluxes(mesh: Mesh, x: float, z: float) -> Fluxes:
    """Return the box fluxes of a unit source at (x, z) [m] in an unbounded plane, with walls."""
    fluxes = radial_half_faces(mesh, x, z).onto_boxes(mesh)
    edges_x = np.concatenate(([0.0], mesh.x[:-1] + 0.5 * mesh.hx, [mesh.width])) - x
    edges_z = np.concatenate(([0.0], mesh.z[:-1] + 0.5 * mesh.hz, [mesh.height])) - z
    share = 1.0 / (2.0 * math.pi)
    for column, wall in ((0, -x), (-1, mesh.width - x)):
        wall_x = np.full(len(edges_z) - 1, wall)
        fluxes.x[:, column] = share * _angle(wall_x, edges_z[:-1], wall_x, edges_z[1:])
    for row, wall in ((0, -z), (-1, mesh.height - z)):
        wall_z = np.full(len(edges_x) - 1, wall)
        fluxes.z[row, :] = share * _angle(edges_x[1:], wall_z, edges_x[:-1], wall_z)
    return fluxes


def _matrix(mesh: Mesh, along_x: FloatArray, along_z: FloatArray) -> csc_matrix:
    """Return the symmetric matrix of the boxes' outflow for unit potentials."""
    numbers = np.arange(mesh.shape[0] * mesh.shape[1]).reshape(mesh.shape)
    corners = [numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, :-1], numbers[1:, 1:]]
    ax = along_x * (0.5 * mesh.hz / mesh.hx)
    az = along_z * (0.5 * mesh.hx / mesh.hz)
    diagonal = 0.75 * (ax + az)
    beside, above = 0.25 * az - 0.75 * ax, 0.25 * ax - 0.75 * az
    across = -0.25 * (ax + az)
    pattern = [
        [diagonal, beside, above, across],
        [beside, diagonal, across, above],
        [above, across, diagonal, beside],
        [across, above, beside, diagonal],
    ]
    rows = np.concatenate([corners[i].ravel() for i in range(4) for _ in range(4)])
    columns = np.concatenate([corners[j].ravel() for _ in range(4) for j in range(4)])
    values = np.concatenate([pattern[i][j].ravel() for i in range(4) for j in range(4)])
    return coo_matrix((values, (rows, columns)), shape=(numbers.size, numbers.size)).tocsc()


class BoxFlow:
    """Flow through sand of a given transmissivity with some vertices at a known potential.

    Without held vertices one corner fixes the level, and the rates must add up to zero.

    Args:
        mesh: the mesh.
        along_x: transmissivity of the elements along x [m^2/s], (nz, nx).
        along_z: the same along z.
        held: vertices at a known potential, (nz + 1, nx + 1).
        canal: those of them in open water, which takes or gives any water; none if None.
        most_iterations: bound of the iterations for a changed transmissivity.
    """

    def __init__(
        self,
        mesh: Mesh,
        along_x: FloatArray,
        along_z: FloatArray,
        *,
        held: NDArray[np.bool_],
        canal: NDArray[np.bool_] | None = None,
        most_iterations: int = MOST_ITERATIONS,
    ) -> None:
        self.mesh = mesh
        self._most_iterations = most_iterations
        self.along_x = along_x
        self.along_z = along_z
        self.held = held
        self._at_walls = held if canal is None else held & ~canal
        fixed = held.copy()
        if not fixed.any():
            fixed[0, 0] = True
        self._free = np.flatnonzero(~fixed.ravel())
        self._factor: Solve = self._factorise(along_x, along_z)

    def _factorise(self, along_x: FloatArray, along_z: FloatArray) -> Solve:
        factor = splu(
            _matrix(self.mesh, along_x, along_z)[self._free][:, self._free],
            permc_spec='MMD_AT_PLUS_A',
            diag_pivot_thresh=0.0,
            options={'SymmetricMode': True},
        )
        return factor.solve

    def _here(
        self, x: float, z: float, along: tuple[FloatArray, FloatArray] | None = None
    ) -> float:
        """Return the transmissivity [m^2/s] of the element at (x, z) [m]."""
        along_x, along_z = (self.along_x, self.along_z) if along is None else along
        column = min(int(x / self.mesh.hx), self.mesh.nx - 1)
        row = min(int(z / self.mesh.hz), self.mesh.nz - 1)
        return math.sqrt(along_x[row, column] * along_z[row, column])

    def _radial(self, x: float, z: float, along_x: FloatArray, along_z: FloatArray) -> HalfFaces:
        """Return the half-face fluxes of the singular potential of a unit well."""
        here = self._here(x, z, (along_x, along_z))
        return radial_half_faces(self.mesh, x, z).scaled(along_x / here, along_z / here)

    def _radial_potential(self, x: float, z: float, here: float) -> FloatArray:
        distance = np.hypot(self.mesh.x[None, :] - x, self.mesh.z[:, None] - z)
        return -np.log(np.maximum(distance, SMALLEST_DIVISOR)) / (2.0 * math.pi * here)

    def well(self, x: float, z: float) -> Fluxes:
        """Return the fluxes of a well at (x, z) [m] that injects 1 m^3/s."""
        return self.combined([(x, z, 1.0)])

    def combined(
        self,
        wells: list[tuple[float, float, float]],
        *,
        held_potential: FloatArray | None = None,
        driven: HalfFaces | None = None,
        forced: Fluxes | None = None,
        along: tuple[FloatArray, FloatArray] | None = None,
    ) -> Fluxes:
        """Return the fluxes of several wells and drives together.

        Args:
            wells: (x [m], z [m], rate [m^3/s]) of every well.
            held_potential: potential of the held vertices [m], (nz + 1, nx + 1); zero if None.
            driven: fluxes that a body force adds, such as buoyancy.
            forced: fluxes through the walls, such as rain.
            along: changed transmissivity along x and z [m^2/s], (nz, nx) each. Conjugate gradients
                solve for it, with the factorised transmissivity as preconditioner.

        Raises:
            InputError: the changed transmissivity differs too much from the factorised one.
        """
        along_x, along_z = (self.along_x, self.along_z) if along is None else along
        potential, extra, supply = self._smooth(
            wells, held_potential=held_potential, driven=driven, forced=forced, along=along
        )
        smooth = bilinear_flow(self.mesh, potential, along_x, along_z).onto_boxes(self.mesh)
        return self._through_open_sides(smooth + extra, supply)

    def potential(
        self,
        wells: list[tuple[float, float, float]],
        *,
        held_potential: FloatArray,
        forced: Fluxes,
    ) -> FloatArray:
        """Return the potential [m] at the vertices, (nz + 1, nx + 1), as `combined` finds it."""
        found, _, _ = self._smooth(wells, held_potential=held_potential, forced=forced)
        for *place, rate in wells:
            x, z = self.mesh.off_faces(*place)
            found = found + rate * self._radial_potential(x, z, self._here(x, z))
        return found

    def _smooth(
        self,
        wells: list[tuple[float, float, float]],
        *,
        held_potential: FloatArray | None = None,
        driven: HalfFaces | None = None,
        forced: Fluxes | None = None,
        along: tuple[FloatArray, FloatArray] | None = None,
    ) -> tuple[FloatArray, Fluxes, FloatArray]:
        """Return the potential without the singular parts of wells, the other fluxes, and the rates
        of the wells by box; arguments as in `combined`."""
        along_x, along_z = (self.along_x, self.along_z) if along is None else along
        known = np.zeros(self.mesh.shape) if held_potential is None else held_potential.copy()
        extra = no_flux(self.mesh)
        supply = np.zeros(self.mesh.shape)
        for *place, rate in wells:
            x, z = self.mesh.off_faces(*place)
            radial = self._radial(x, z, along_x, along_z)
            extra = extra + radial.onto_boxes(self.mesh) * rate
            supply[self._box_of(x, z)] += rate
            if self.held.any():
                known -= rate * self._radial_potential(x, z, self._here(x, z, along))
        if driven is not None:
            extra = extra + driven.onto_boxes(self.mesh)
        if forced is not None:
            extra = extra + forced
        known = np.where(self.held, known, 0.0)
        smooth = bilinear_flow(self.mesh, known, along_x, along_z).onto_boxes(self.mesh)
        demand = (supply - extra.outflow - smooth.outflow).ravel()[self._free]
        potential = known.ravel()
        potential[self._free] += self._solve(demand, along)
        return potential.reshape(self.mesh.shape), extra, supply

    def through_walls(self, forced: Fluxes) -> Fluxes:
        """Return the fluxes with the `forced` fluxes through the walls.

        Only for sand without held vertices; inflow and outflow must balance.
        """
        potential = np.zeros(self.mesh.shape[0] * self.mesh.shape[1])
        potential[self._free] = self._factor((-forced.outflow).ravel()[self._free])
        potential = potential.reshape(self.mesh.shape)
        smooth = bilinear_flow(self.mesh, potential, self.along_x, self.along_z)
        return smooth.onto_boxes(self.mesh) + forced

    def _solve(self, demand: FloatArray, along: tuple[FloatArray, FloatArray] | None) -> FloatArray:
        if along is None:
            return self._factor(demand)
        size = len(demand)
        padded = np.zeros(self.mesh.shape[0] * self.mesh.shape[1])

        def outflow(potential: FloatArray) -> FloatArray:
            padded[self._free] = potential
            flow = bilinear_flow(self.mesh, padded.reshape(self.mesh.shape), *along)
            return flow.onto_boxes(self.mesh).outflow.ravel()[self._free]

        solution, unfinished = cg(
            LinearOperator((size, size), outflow, dtype=float),
            demand,
            atol=0.0,
            **{RELATIVE: TOLERANCE},
            maxiter=self._most_iterations,
            M=LinearOperator((size, size), self._factor, dtype=float),
        )
        if unfinished:
            raise InputError(
                f'flow: not found in {self._most_iterations} iterations; '
                'choose a viscosity_ratio closer to 1'
            )
        return solution

    def _box_of(self, x: float, z: float) -> tuple[int, int]:
        return (int(z / self.mesh.hz + 0.5), int(x / self.mesh.hx + 0.5))

    def _through_open_sides(self, fluxes: Fluxes, supply: FloatArray) -> Fluxes:
        """Return the fluxes with the gain of the held boxes leaving through their side."""
        if not self._at_walls.any():
            return fluxes
        gain = np.where(self._at_walls, supply - fluxes.outflow, 0.0)
        for row, wall, outward in ((-1, -1, 1.0), (0, 0, -1.0)):
            through = gain[row].copy()
            # at a corner water takes the wall that is held beside it
            through[[0, -1]] *= self._at_walls[row, [1, -2]]
            fluxes.z[wall] += outward * through
            gain[row] -= through
        fluxes.x[:, 0] -= gain[:, 0]
        fluxes.x[:, -1] += gain[:, -1]
        return fluxes
