"""Water at parts of the sand of the virtual rig: exact rates, balances, and the solver's answer."""

import math

import numpy as np
import pytest
from rig_examples import make_rig, rates
from scipy.special import erfc

from porotwin_core.basis.units import GRAVITY, ML_H
from porotwin_rig.effects import EffectSet, parse_effects
from porotwin_rig.mesh import Mesh
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_rig.water_flow import WaterFlow
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.coefficients.water_contact import entering
from porotwin_solver.flow.background_flux import background_flux

POLYGON = [[0.40, 0.40], [0.55, 0.40], [0.55, 0.50], [0.40, 0.50]]
WATER = {
    'high': {'side': 'left', 'from_m': 0.3, 'head_m': 0.58, 'concentration': 0.6},
    'low': {'corners_m': POLYGON, 'head_m': 0.57},
    'rain': {'side': 'top', 'to_m': 0.3, 'rate_ml_h': 200.0, 'concentration': 0.8},
}


def tank(water: dict, **others):
    return make_rig(boundaries={'top': 'closed'}, control=None, water=water, **others)


def fluxes_of(rig, mesh: Mesh, effects: str = '', tracer: float = 0.0):
    true = EffectSet.checked(parse_effects(effects), rig).applied(TrueRig.nominal(rig, mesh))
    return WaterFlow(true).fluxes({}, np.full(mesh.shape, tracer), 0.0)


def inflow(fluxes) -> float:
    sides = (fluxes.x[:, 0], -fluxes.x[:, -1], fluxes.z[0], -fluxes.z[-1])
    return sum(float(np.maximum(side, 0.0).sum()) for side in sides)


@pytest.mark.parametrize('effects', ['', 'viscosity:viscosity_ratio=1.5'])
def test_every_box_outside_the_canal_conserves_water(effects) -> None:
    rig, mesh = tank(WATER), Mesh(61, 37, 0.934, 0.562)
    fluxes = fluxes_of(rig, mesh, effects, tracer=0.3)
    canal = TrueRig.nominal(rig, mesh).water_places.canal
    total = inflow(fluxes)
    assert np.abs(fluxes.outflow[~canal]).max() < 1e-6 * total
    assert fluxes.outflow[canal].sum() == pytest.approx(-total, rel=1e-6)
    assert -fluxes.z[-1].sum() == pytest.approx(200.0 * ML_H)


def test_both_simulators_find_the_same_rates() -> None:
    rig = tank(WATER)
    mine = inflow(fluxes_of(rig, Mesh(187, 113, 0.934, 0.562)))
    flux = background_flux(nominal_physics(rig, rig.grid(187, 112)))
    theirs = sum(float(np.maximum(side, 0.0).sum()) for side in entering(flux))
    assert mine == pytest.approx(theirs, rel=0.02)


def test_a_strip_of_water_on_deep_sand_has_the_rate_of_confocal_ellipses() -> None:
    """q = pi K fall / arcsinh(r / a) (Harr, Groundwater and Seepage, sec. 7-3)."""
    half, deep = 0.05, 0.3
    axis = math.hypot(half, deep)
    ring = [
        (0.5 + axis * math.cos(a), 0.5 - deep * math.sin(a) + (0.001 if a in (0.0, math.pi) else 0))
        for a in np.linspace(0.0, math.pi, 181)
    ]
    water = {
        'strip': {'side': 'top', 'from_m': 0.5 - half, 'to_m': 0.5 + half, 'head_m': 0.6},
        'rim': {
            'corners_m': [*ring, (-0.01, 0.51), (-0.01, -0.01), (1.01, -0.01), (1.01, 0.51)],
            'head_m': 0.5,
        },
    }
    rig = tank(water, width_m=1.0, height_m=0.5, wells={'idle': {'x_m': 0.5, 'z_m': 0.35}})
    conductivity = 6.57e-10 * 998.0 * GRAVITY / 1e-3
    expected = math.pi * conductivity * 0.010 * 0.1 / math.asinh(deep / half)
    assert inflow(fluxes_of(rig, Mesh(161, 81, 1.0, 0.5))) == pytest.approx(expected, rel=0.04)


def test_dense_water_stands_still_in_sand_that_is_full_of_it() -> None:
    water = {
        'sea': {'side': 'left', 'head_m': 0.6, 'concentration': 1.0},
        'pond': {'corners_m': POLYGON, 'head_m': 0.6, 'concentration': 1.0},
    }
    mesh, effect = Mesh(41, 25, 0.934, 0.562), 'buoyancy:density_difference=25'
    full, empty = (fluxes_of(tank(water), mesh, effect, tracer=c) for c in (1.0, 0.0))
    assert np.abs(empty.x).max() > 0.0
    np.testing.assert_allclose(full.x, 0.0, atol=1e-9 * np.abs(empty.x).max())
    np.testing.assert_allclose(full.z, 0.0, atol=1e-9 * np.abs(empty.x).max())


def test_tracer_is_conserved_between_wells_canals_and_rain() -> None:
    asset = VirtualRig(tank(WATER), cell=0.015)
    asset.set_rates(rates(injector=(300.0, 1.0)))
    for _ in range(10):
        asset.advance(120.0)
    balance = asset.balance
    assert asset.total_mass() == pytest.approx(balance.injected - balance.removed, rel=1e-6)
    rain, well = 0.8 * 200.0, 300.0
    assert balance.injected > (rain + well) * ML_H * 1200.0
    assert balance.corrected < 0.2 * balance.injected


def test_water_that_enters_brings_its_concentration() -> None:
    water = {
        'in': {'side': 'left', 'head_m': 0.62, 'concentration': 0.7},
        'out': {'side': 'right', 'head_m': 0.60},
    }
    asset = VirtualRig(tank(water), cell=0.015)
    speed = 6.57e-10 * 998.0 * GRAVITY / 1e-3 * 0.02 / 0.934 / 0.375
    asset.advance(0.4 / speed)
    grid = asset.rig.grid(60, 10)
    filled = asset.concentration(grid)[5]
    assert filled.max() == pytest.approx(0.7, abs=1e-6)
    assert float(filled.sum() * grid.dx) == pytest.approx(0.7 * 0.4, rel=0.02)


def test_tracer_diffuses_from_a_side_as_into_a_half_space() -> None:
    """c = erfc(x / (2 sqrt(D t))) in still water (Crank, The Mathematics of Diffusion, 1975)."""
    water = {'lake': {'side': 'left', 'head_m': 0.6, 'concentration': 1.0, 'diffuses': True}}
    asset = VirtualRig(
        tank(water),
        effects=parse_effects(
            'dispersion:longitudinal_dispersivity=0,transverse_dispersivity=0,diffusion=1e-6'
        ),
        cell=0.01,
    )
    for _ in range(30):
        asset.advance(120.0)
    grid = asset.rig.grid(60, 4)
    expected = erfc(grid.x / (2.0 * math.sqrt(1e-6 * 3600.0)))
    np.testing.assert_allclose(asset.concentration(grid)[2], expected, atol=0.03)
