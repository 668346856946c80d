"""The steady water table in the sand, for given rates: a free surface on a fixed grid.

Sand is full of water up to the capillary fringe, to the height at which the pressure head is the
negative height b of the fringe: h = z - b. Above it no water moves sideways; rain moves down to it.
With the share w of each cell that lies below this surface, its sideways transmissibility counts
w-fold (Bear, Dynamics of Fluids in Porous Media, sec. 8.1; for fixed grids Desai and Li, Adv. Water
Resour. 6 (1983) 101). Summed over a column this is Dupuit's K (h + b). Newton's method finds it.

Water stands against a side up to its level. Above it the side seeps: water leaves where its head
exceeds its height, and none enters.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_core.geometry.grid import FloatArray
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.water_contact import Outline, WaterContact, outer_flux
from porotwin_solver.flow.background_flux import driven_by_water
from porotwin_solver.flow.flow import MOST_STRAY, SHARED_FLOWS, transmissibilities

LEAST_WET = 1e-6
"""Share of a cell that carries water sideways above the surface [-]: so no cell is cut off."""

MOST_STEPS = 200
"""Steps of Newton's method; ten to forty are usual."""


class TableFlow:
    """The water table under one set of sources, and the flow below it.

    Attributes:
        physics: the coefficients with the contact of the water as the table makes it.
        flux: through the faces [m^3/s].
        surface: share of each cell below the upper edge of the fringe [-], (nz, nx).
    """

    def __init__(self, physics: Physics, source: FloatArray) -> None:
        """Find the table for `source` (nz, nx) [m^3/s], the net rate into each cell.

        Raises:
            InputError: it does not settle, or `physics` has a flow that no level of water drives.
        """
        if any(physics.background_flux) or physics.table_tilt:
            raise InputError(
                'water_table: only levels and rain drive the water below a table in the sand, and '
                'background_flow would go through dry sand too; use water_body or water_level'
            )
        grid, self._contact = physics.grid, physics.contact
        self._grid, self._weight = grid, physics.density * GRAVITY
        assert physics.fringe is not None
        lowest_full = grid.z[:, None] - 0.5 * grid.dz - physics.fringe - self._contact.lowest
        self._bottom = np.broadcast_to(self._weight * lowest_full, grid.shape)
        self._trans = transmissibilities(grid, physics.mobility_thickness, self._contact)
        whole = replace(self._contact, open=Outline.zeros(grid).map(np.ones_like))
        full = transmissibilities(grid, physics.mobility_thickness, whole)
        self._half = Outline(full.x[:, 0], full.x[:, -1], full.z[0], full.z[-1])
        rain = outer_flux(self._contact.rain).divergence()
        self._source = self._contact.where_canal(source - rain, np.zeros(grid.shape))
        self._pressure = self._found()
        self.surface, _ = self._wet(self._pressure)
        self.physics = replace(physics, surface=self._frozen())
        flow = SHARED_FLOWS.flow(grid, physics.mobility_thickness, self.physics.contact)
        self.flux = flow.flux(source, driven_by_water(self.physics, flow.transmissibility))
        self._factor = splu(self._jacobian(self._pressure))

    def flux_per_source(self, source: FloatArray) -> FaceField:
        """Return dflux of a small additional `source` (nz, nx), per unit of it: the table moves."""
        change = self._factor.solve(self._contact.where_canal(source, 0.0 * source).ravel())
        change = change.reshape(self._grid.shape)
        _, slope = self._wet(self._pressure)
        mean, by_low, by_high = self._means(self._pressure)
        p, trans, flux = self._pressure, self._trans, FaceField.zeros(self._grid)
        fall, fall_change = p[:, :-1] - p[:, 1:], change[:, :-1] - change[:, 1:]
        moved = by_low * change[:, :-1] + by_high * change[:, 1:]
        flux.x[:, 1:-1] = trans.x[:, 1:-1] * (mean * fall_change + moved * fall)
        flux.z[1:-1] = trans.z[1:-1] * (change[:-1] - change[1:])
        leaving, _ = self._leaving(p, slope)
        beside = Outline(change[:, 0], change[:, -1], change[0], change[-1])
        out = outer_flux(leaving.map(lambda by, at: -by * at, beside))
        return flux + out

    def _wet(self, pressure: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the share of each cell below the surface, and its derivative [1/Pa]."""
        height = self._weight * self._grid.dz
        share = (pressure - self._bottom) / height
        slope = np.where((share > LEAST_WET) & (share < 1.0), 1.0 / height, 0.0)
        return np.clip(share, LEAST_WET, 1.0), slope

    def _means(self, pressure: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the wet share of the inner vertical faces, and its derivatives by both cells.

        It is the mean of both cells; to open water, the one of the sand.
        """
        wet, slope = self._wet(pressure)
        low, high = np.full((2, *wet[:, 1:].shape), 0.5)
        if (canal := self._contact.canal) is not None:
            low = np.where(canal[:, :-1], 0.0, np.where(canal[:, 1:], 1.0, low))
            high = 1.0 - low
        mean = low * wet[:, :-1] + high * wet[:, 1:]
        return mean, low * slope[:, :-1], high * slope[:, 1:]

    def _leaving(self, p: FloatArray, slope: FloatArray) -> tuple[Outline, Outline]:
        """Return the derivative by the pressure [m^3/(s Pa)] of the water that leaves through each
        outer face, and that water [m^3/s]."""
        wet, _ = self._wet(p)
        none = np.ones(len(p[0]))
        found, derivative = [], []
        for half, share, seep, head, height, at, w, dw in zip(
            self._half,
            self._contact.open,
            self._contact.seep,
            self._contact.head,
            self._heights(),
            (p[:, 0], p[:, -1], p[0], p[-1]),
            (wet[:, 0], wet[:, -1], none, none),
            (slope[:, 0], slope[:, -1], 0.0 * none, 0.0 * none),
            strict=True,
        ):
            above = at - self._weight * head
            out = np.maximum(at - self._weight * height, 0.0)
            total = half * (share * above + seep * out)
            found.append(w * total)
            derivative.append(w * half * (share + seep * (out > 0.0)) + dw * total)
        return Outline(*derivative), Outline(*found)

    def _heights(self) -> Outline:
        """Return the height of each outer face above the lowest level [m]."""
        grid, lowest = self._grid, self._contact.lowest
        low, high = np.full(grid.nx, -lowest), np.full(grid.nx, grid.height - lowest)
        return Outline(grid.z - lowest, grid.z - lowest, low, high)

    def _excess(self, p: FloatArray) -> FloatArray:
        """Return the water that leaves each cell beyond its source [m^3/s], zero in canals."""
        mean, _, _ = self._means(p)
        flux = FaceField.zeros(self._grid)
        flux.x[:, 1:-1] = self._trans.x[:, 1:-1] * mean * (p[:, :-1] - p[:, 1:])
        flux.z[1:-1] = self._trans.z[1:-1] * (p[:-1] - p[1:])
        _, leaving = self._leaving(p, self._wet(p)[1])
        flux = flux + outer_flux(leaving.map(np.negative))
        return self._contact.where_canal(flux.divergence() - self._source, 0.0 * p)

    def _jacobian(self, p: FloatArray) -> coo_matrix:
        """Return the derivative of `_excess` by the pressure; the identity in canals."""
        nz, nx = p.shape
        mean, by_low, by_high = self._means(p)
        fall, tx = p[:, :-1] - p[:, 1:], self._trans.x[:, 1:-1]
        tz = self._trans.z[1:-1]
        number = np.arange(nz * nx).reshape(nz, nx)
        west, east, south, north = number[:, :-1], number[:, 1:], number[:-1], number[1:]
        low, high = tx * (mean + by_low * fall), tx * (by_high * fall - mean)
        outer, _ = self._leaving(p, self._wet(p)[1])
        sides = (number[:, 0], number[:, -1], number[0], number[-1])
        entries = [
            (west, west, low),
            (west, east, high),
            (east, west, -low),
            (east, east, -high),
            (south, south, tz),
            (south, north, -tz),
            (north, south, -tz),
            (north, north, tz),
            *((side, side, by) for side, by in zip(sides, outer, strict=True)),
        ]
        rows, columns, values = (np.concatenate([e[k].ravel() for e in entries]) for k in range(3))
        if (canal := self._contact.canal) is not None:
            held = canal.ravel()
            kept = ~(held[rows] | held[columns])
            own = np.flatnonzero(held)
            rows, columns = np.append(rows[kept], own), np.append(columns[kept], own)
            values = np.append(values[kept], np.full(len(own), float(tx.max())))
        return coo_matrix((values, (rows, columns)), shape=(nz * nx,) * 2).tocsc()

    def _found(self) -> FloatArray:
        """Return the pressure [Pa] at the steady table.

        Raises:
            InputError: it does not settle.
        """
        p = np.full(self._grid.shape, self._weight * self._contact.highest)
        p = self._contact.where_canal(p, self._weight * self._contact.canal_head)
        wanted = MOST_STRAY * float(self._trans.x.max()) * self._weight * self._grid.dz
        left = self._excess(p)
        for _ in range(MOST_STEPS):
            if np.abs(left).max() <= wanted:
                return p
            step = -splu(self._jacobian(p)).solve(left.ravel()).reshape(p.shape)
            size = 1.0
            for size in 0.5 ** np.arange(8):
                trial = p + size * step
                after = self._excess(trial)
                if np.linalg.norm(after) < (1.0 - 0.1 * size) * np.linalg.norm(left):
                    break
            p, left = p + size * step, self._excess(p + size * step)
        raise InputError(
            f'water_table: no steady table found on {self._grid}; take another grid, and check '
            'that the water has an outlet below its level'
        )

    def _frozen(self) -> WaterContact:
        """Return the contact of the water with the table where it is."""
        p, contact = self._pressure, self._contact
        wet, _ = self._wet(p)
        mean, _, _ = self._means(p)
        scale = FaceField.zeros(self._grid)
        scale.x[:], scale.z[:] = 1.0, 1.0
        scale.x[:, 1:-1] = mean
        heights = self._heights()
        beside = Outline(p[:, 0], p[:, -1], p[0], p[-1])
        seeping = beside.map(
            lambda at, z, seep: seep * (at > self._weight * z), heights, contact.seep
        )
        both = contact.open.map(np.add, seeping)
        head = contact.head.map(
            lambda level, share, seep, z: np.divide(
                share * level + seep * z,
                share + seep,
                out=np.zeros_like(level),
                where=share + seep > 0.0,
            ),
            contact.open,
            seeping,
            heights,
        )
        through = Outline(both.left * wet[:, 0], both.right * wet[:, -1], both.bottom, both.top)
        return replace(contact, open=through, head=head, scale=scale)
