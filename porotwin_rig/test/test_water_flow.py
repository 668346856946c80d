"""The water of the virtual rig between open sides with different heads."""

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.units import GRAVITY
from porotwin_rig.effects import EffectSet, parse_effects
from porotwin_rig.mesh import Mesh
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_rig.water_flow import WaterFlow

BETWEEN = {
    'top': 'closed',
    'left': 'open',
    'right': 'open',
    'heads_m': {'left': 0.62, 'right': 0.6},
}
DARCY = 6.57e-10 * 998.0 * GRAVITY / 1e-3 * 0.010 * 0.562 * 0.02 / 0.934
"""The rate between these heads by Darcy's law [m^3/s]."""


def water_flow(effects: str = '', **keys: object) -> WaterFlow:
    rig = make_rig(boundaries=BETWEEN, control=None, **keys)
    mesh = Mesh(31, 21, rig.width_m, rig.height_m)
    nominal = TrueRig.nominal(rig, mesh)
    return WaterFlow(EffectSet.checked(parse_effects(effects), rig).applied(nominal))


def test_heads_drive_the_rate_of_darcys_law() -> None:
    fluxes = water_flow().fluxes({}, np.zeros((22, 32)), 0.0)
    np.testing.assert_allclose(fluxes.x.sum(axis=0), DARCY, rtol=1e-9)
    np.testing.assert_allclose(fluxes.z, 0.0, atol=1e-12 * DARCY)


def test_a_viscous_tracer_slows_the_water_between_heads() -> None:
    flow = water_flow('viscosity:viscosity_ratio=2')
    for tracer, share in ((0.0, 1.0), (1.0, 0.5)):
        fluxes = flow.fluxes({}, np.full((22, 32), tracer), 0.0)
        np.testing.assert_allclose(fluxes.x.sum(axis=0), share * DARCY, rtol=1e-6)


def test_a_wrong_water_level_drives_the_rate_of_darcys_law() -> None:
    flow = water_flow('water_level:left=0.01,right=-0.01')
    fluxes = flow.fluxes({}, np.zeros((22, 32)), 0.0)
    np.testing.assert_allclose(fluxes.x.sum(axis=0), 2.0 * DARCY, rtol=1e-9)


@pytest.mark.parametrize('effects', ['', 'viscosity:viscosity_ratio=2'])
def test_a_level_that_changes_drives_the_rate_of_darcys_law_at_each_time(effects: str) -> None:
    flow = water_flow(effects, levels={'left': {'points': [[10, 0.64]]}})
    for time in (0.0, 300.0, 600.0, 900.0):
        fluxes = flow.fluxes({}, np.zeros((22, 32)), time)
        expected = (1.0 + min(time / 600.0, 1.0)) * DARCY
        np.testing.assert_allclose(fluxes.x.sum(axis=0), expected, rtol=1e-6)


def test_water_levels_that_rise_alike_drive_nothing() -> None:
    alike = water_flow('water_level:left=0.3,right=0.3').fluxes({}, np.zeros((22, 32)), 0.0)
    np.testing.assert_allclose(alike.x.sum(axis=0), DARCY, rtol=1e-9)


def test_no_more_tracer_leaves_than_was_injected() -> None:
    heads = {'left': 0.70, 'right': 0.6}
    asset = VirtualRig(make_rig(boundaries={**BETWEEN, 'heads_m': heads}, control=None), cell=0.02)
    asset.set_rates(rates(injector=(500.0, 1.0)))
    asset.advance(60.0)
    asset.set_rates(rates(injector=0.0))
    for _ in range(12):
        asset.advance(300.0)
    balance = asset.balance
    assert 0.9 * balance.injected < balance.removed <= balance.injected * (1.0 + 1e-9)
