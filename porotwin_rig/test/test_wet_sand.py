"""The water table of the virtual rig, compared with exact discharges and with the solver."""

import numpy as np
import pytest
from rig_examples import make_rig, rates

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY, ML_H
from porotwin_core.rates.wells import WellRate
from porotwin_rig.effects import EffectSet, parse_effects
from porotwin_rig.mesh import Mesh
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_rig.water_flow import WaterFlow
from porotwin_solver.model.model import Model

CONDUCTIVITY = 6.57e-10 * 998.0 * GRAVITY / 1e-3
DEPTH, WIDTH, HIGH, LOW = 0.010, 0.934, 0.45, 0.25


def tank(*, low: float = LOW, fringe: float = 0.0, **more):
    water = {'high': {'side': 'left', 'head_m': HIGH}, 'low': {'side': 'right', 'head_m': low}}
    return make_rig(
        boundaries={'top': 'closed'},
        control=None,
        water={**water, **more},
        water_table={'fringe_m': fringe},
    )


def fluxes_of(rig, pumped: dict[str, WellRate] | None = None, effects: str = ''):
    mesh = Mesh(91, 55, rig.width_m, rig.height_m)
    true = EffectSet.checked(parse_effects(effects), rig).applied(TrueRig.nominal(rig, mesh))
    return WaterFlow(true).fluxes(pumped or {}, np.zeros(mesh.shape), 0.0)


def test_the_discharge_between_two_levels_is_charnys() -> None:
    """q = K (h1^2 - h2^2) / (2 L), exact with a seepage face (Charny 1951; Bear 1972, sec. 8.1)."""
    fluxes = fluxes_of(tank())
    through = fluxes.x.sum(axis=0)
    exact = CONDUCTIVITY * DEPTH * (HIGH**2 - LOW**2) / (2.0 * WIDTH)
    np.testing.assert_allclose(through, through[0], rtol=1e-6)
    assert through[0] == pytest.approx(exact, rel=0.015)


def test_rain_parts_as_in_dupuits_flow() -> None:
    """q(0) = K (h1^2 - h2^2) / (2 L) - N L / 2 (Bear 1972, sec. 8.2)."""
    rate = 1000.0
    dry, wet = (
        fluxes_of(tank(low=0.40, **rain)).x
        for rain in ({}, {'rain': {'side': 'top', 'rate_ml_h': rate}})
    )
    left = float((dry[:, 0] - wet[:, 0]).sum())
    assert left == pytest.approx(rate * ML_H / 2.0, rel=0.03)
    assert float(wet[:, -1].sum() - wet[:, 0].sum()) == pytest.approx(rate * ML_H, rel=1e-6)


@pytest.mark.parametrize('effects', ['', 'fringe:rise=0.03'])
def test_both_simulators_find_the_same_flow_with_wells_and_a_fringe(effects) -> None:
    rig, pumped = tank(low=0.40, fringe=0.03), rates(injector=150.0, producer=-100.0)
    mine = fluxes_of(rig, pumped, effects)
    model = Model(rig, rig.grid(93, 56), preset='fast', effects=parse_effects(effects))
    theirs = model.engine.water_flux(pumped)
    for side in (0, -1):
        assert float(mine.x[:, side].sum()) == pytest.approx(
            float(theirs.x[:, side].sum()), rel=0.03
        )


def test_tracer_is_conserved_below_a_table() -> None:
    rain = {'side': 'top', 'to_m': 0.5, 'rate_ml_h': 100.0, 'concentration': 0.5}
    asset = VirtualRig(tank(low=0.40, fringe=0.03, rain=rain), cell=0.02)
    asset.set_rates(rates(injector=(100.0, 1.0)))
    for _ in range(6):
        asset.advance(200.0)
    balance = asset.balance
    assert asset.total_mass() == pytest.approx(balance.injected - balance.removed, rel=1e-6)
    assert balance.injected == pytest.approx(150.0 * ML_H * 1200.0, rel=1e-6)


@pytest.mark.parametrize(
    'effect', ['background_flow:x_velocity=1e-6', 'water_table:amplitude=0.01']
)
def test_water_that_no_level_drives_is_refused_below_a_table(effect) -> None:
    with pytest.raises(InputError, match='only levels and rain'):
        fluxes_of(tank(), effects=effect)
