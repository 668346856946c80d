"""Where water enters and leaves a rig, and through which sand it flows, for constant rates."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.geometry.polygons import inside
from porotwin_core.rates.wells import WellRates, with_rises
from porotwin_core.rig import Rig, SideName
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.coefficients.water_contact import Outline, entering, side_cover
from porotwin_solver.effects import described_physics
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.flow.flow import SHARED_FLOWS
from porotwin_solver.flow.water_table import TableFlow
from porotwin_solver.transport.sources_and_sinks import SourcesAndSinks

SIDES: tuple[SideName, ...] = ('left', 'right', 'bottom', 'top')
"""The sides in the order of an `Outline`."""


@dataclass(frozen=True)
class WaterBalance:
    """Rates [m^3/s] of pure water, positive into the sand.

    Attributes:
        wells: of wells and leaks, by name.
        places: of open sides and other water, by name.
        sands: through the sands of the middle of the rig, positive to the right; empty for one.
        levels: for which it holds, of the water whose level changes [m], by name.
    """

    wells: Mapping[str, float]
    places: Mapping[str, float]
    sands: Mapping[str, float]
    levels: Mapping[str, float]

    @property
    def in_ml_h(self) -> dict[str, dict[str, float]]:
        """All rates in ml/h."""
        return {
            part: {name: to_ml_h(rate) for name, rate in getattr(self, part).items()}
            for part in ('wells', 'places', 'sands')
        }

    def __str__(self) -> str:
        """Return the balance on one line."""
        wells, places, sands = (_in_words(rates) for rates in self.in_ml_h.values())
        levels = ''.join(f'{name} at {level:g} m, ' for name, level in self.levels.items())
        told = f'{levels}into the sand [ml/h]: {"; ".join(filter(None, (wells, places)))}'
        return told if not sands else f'{told}; to the right through the middle: {sands}'


def _in_words(rates_ml_h: Mapping[str, float]) -> str:
    """Return rates [ml/h] in words."""
    return ', '.join(f'{name} {rate:+z.1f}' for name, rate in rates_ml_h.items())


def water_balance(rig: Rig, grid: Grid, rates: WellRates) -> WaterBalance | None:
    """Return the balance of `rig` with its effects at `rates` [m^3/s].

    Water whose level `rates` do not tell stands as described. None where it has none: wells that do
    not balance in a closed rig.
    """
    rates = {**with_rises({}, dict.fromkeys(rig.levels, 0.0)), **rates}
    physics = described_physics(rig, grid).at_levels(rates)
    delivered = {name: rate for name, rate in physics.delivered(rates).items() if rate}
    wells = {**delivered, **({'leaks': leaks} if (leaks := _leaks(physics)) else {})}
    if physics.surplus(rates) != 0.0:
        return None
    flux = _flux(physics, rates)
    places = {**at_sides(rig, grid, entering(flux)), **into_canals(rig, grid, flux)}
    levels = {
        name: (rig.water_bodies[name].head_m or 0.0) + rates[name].rise for name in rig.levels
    }
    return WaterBalance(wells, places, _through_sands(rig, grid, flux), levels)


def into_canals(rig: Rig, grid: Grid, flux: FaceField) -> dict[str, float]:
    """Return the rates [m^3/s] into the sand by canal, from the `flux` through all faces."""
    return {
        name: float(flux.divergence()[_within(body.corners_m, grid)].sum())
        for name, body in rig.water.items()
        if body.corners_m is not None
    }


def at_sides(rig: Rig, grid: Grid, outline: Outline) -> dict[str, float]:
    """Return the rates [m^3/s] into the sand by the water at its sides, else by the side.

    `outline` holds those through the outer faces of `grid`.
    """
    found: dict[str, float] = {}
    for side, into in zip(SIDES, outline, strict=True):
        covers = {
            name: side_cover(grid, side, body.from_m, body.to_m)
            for name, body in rig.water_bodies.items()
            if body.side == side
        }
        covered = np.sum([np.zeros_like(into), *covers.values()], axis=0)
        if np.any(bare := into[covered == 0.0]):
            found[side] = float(bare.sum())
        for name, cover in covers.items():
            share = np.divide(cover, covered, out=np.zeros_like(into), where=covered > 0.0)
            found[name] = found.get(name, 0.0) + float((into * share).sum())
    return found


def _leaks(physics: Physics) -> float:
    return math.fsum(leak.rate for leak in physics.leaks)


def _flux(physics: Physics, rates: WellRates) -> FaceField:
    """Return the flux [m^3/s] of pure water."""
    source = SourcesAndSinks(physics).sources(rates).net
    if physics.fringe is not None:
        return TableFlow(physics, source).flux
    flow = SHARED_FLOWS.flow(physics.grid, physics.mobility_thickness, physics.contact)
    by_wells, background = flow.flux(source), background_flux(physics)
    return by_wells if background is None else by_wells + background


def _within(corners: object, grid: Grid) -> NDArray[np.bool_]:
    """Return True in the cells (nz, nx) whose centre lies in the polygon."""
    x, z = np.meshgrid(grid.x, grid.z)
    points = np.column_stack([x.ravel(), z.ravel()])
    return np.asarray(inside(points, np.array(corners))).reshape(grid.shape)


def _through_sands(rig: Rig, grid: Grid, flux: FaceField) -> dict[str, float]:
    """Return the flux [m^3/s] to the right through the middle of the rig, by sand.

    The sands of one cell share its flux by their area times their permeability.
    """
    if len(rig.sands) < 2:
        return {}
    middle = grid.nx // 2
    conducts: dict[str, FloatArray] = {}
    for name in rig.sands:
        own = rig.permeability_of_sand(name)
        share = conservative_resample(own * rig.is_of_sand(name), grid.shape)
        conducts[name] = share[:, max(middle - 1, 0) : middle + 1].mean(axis=1)
    total = np.sum(list(conducts.values()), axis=0)
    return {
        name: float(flux.x[:, middle] @ np.divide(part, total, out=0.0 * part, where=total > 0.0))
        for name, part in conducts.items()
        if part.any()
    }
