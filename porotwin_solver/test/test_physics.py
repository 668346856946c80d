"""Water whose level changes: Darcy's law at each time, and every volume that enters."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig
from porotwin_solver.adjoint import gradient
from porotwin_solver.effects import described_physics, parse_effects
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate
from porotwin_solver.model.water_balance import water_balance

SEA = {'side': 'left', 'head_m': 0.60, 'concentration': 1.0}
TIDE = {'sea': {'points': [[10, 0.62], [10, 0.61], [20, 0.61]]}}


@pytest.fixture
def rig(make_rig) -> Rig:
    """Return uniform sand between a sea of tracer on the left and a lake on the right."""
    lake = {'side': 'right', 'head_m': 0.60}
    return make_rig(
        boundaries={'top': 'closed'}, water={'sea': SEA, 'lake': lake}, levels=TIDE, control=None
    )


def announced(rig: Rig) -> Schedule:
    return FixedPauses.of(rig).in_schedule(Schedule())


def darcy(rig: Rig) -> float:
    """Return K A / L [m^2/s]: the rate for each metre of head between the sides."""
    conductivity = rig.permeability_m2 * rig.density_kg_m3 * GRAVITY / rig.viscosity_pa_s
    return conductivity * rig.depth_m * rig.height_m / rig.width_m


def fall(time: float) -> float:
    """Return the head of the sea above the lake [m]."""
    return 0.02 * time / 600.0 if time < 600.0 else 0.01


@pytest.mark.parametrize('effect', ['', 'viscosity:viscosity_ratio=2'])
def test_the_flux_follows_darcys_law_at_each_time(rig, effect: str) -> None:
    effects = parse_effects([effect] if effect else [])
    model = Model(rig, rig.grid(24, 12), preset='fast', effects=effects)
    engine = model.engine
    full = np.full(engine.grid.shape, 1.0 if effect else 0.0)
    for low, high, rates in announced(rig).intervals(0.0, 900.0):
        expected = darcy(rig) * fall(0.5 * (low + high)) / (2.0 if effect else 1.0)
        flux = engine.coupled_flux(engine.water_flux(rates), rates, full)
        np.testing.assert_allclose(flux.x.sum(axis=0), expected, rtol=1e-6)


def test_the_rig_holds_all_tracer_that_the_sea_let_in(rig) -> None:
    grid = rig.grid(24, 12)
    (found,) = simulate(rig, announced(rig), [900.0], grid=grid, preset='fast')
    entered = darcy(rig) * (0.5 * 0.02 * 600.0 + 0.01 * 300.0)
    held = float((found * rig.cell_pore_volume(grid)).sum())
    np.testing.assert_allclose(held, entered, rtol=1e-6)


def test_the_balance_is_that_of_the_moment(rig) -> None:
    *_, (_, _, rates) = announced(rig).intervals(0.0, 900.0)
    balance = water_balance(rig, rig.grid(24, 12), rates)
    assert balance is not None
    np.testing.assert_allclose(balance.places['sea'], darcy(rig) * 0.01, rtol=1e-6)


def test_a_table_in_the_sand_follows_the_levels(make_rig) -> None:
    """Q = K d (h1^2 - h2^2) / (2 L) (Dupuit), with the level of each time."""
    still = make_rig(
        boundaries={'top': 'closed'},
        water={'one': {'side': 'left', 'head_m': 0.3}, 'other': {'side': 'right', 'head_m': 0.3}},
        levels={'one': {'points': [[1, 0.4]]}},
        water_table={'fringe_m': 0.0},
        control=None,
    )
    engine = Model(still, still.grid(40, 24), preset='fast').engine
    *_, (_, _, rates) = announced(still).intervals(0.0, 600.0)
    depth_and_conductivity = darcy(still) * still.width_m / still.height_m
    expected = depth_and_conductivity * (0.4**2 - 0.3**2) / (2.0 * still.width_m)
    np.testing.assert_allclose(engine.water_flux(rates).x[:, 0].sum(), expected, rtol=0.02)


def test_rates_without_the_levels_are_refused(rig) -> None:
    with pytest.raises(InputError, match='the level of sea changes'):
        described_physics(rig, rig.grid(24, 12)).at_levels({})
    with pytest.raises(InputError, match='the level of sea changes'):
        simulate(rig, Schedule(), [60.0], grid=rig.grid(24, 12))


def test_the_gradient_follows_the_levels(rig) -> None:
    setting = {'grid': rig.grid(24, 12), 'preset': 'fast'}

    def cost(factor: float) -> float:
        effects = parse_effects([f'permeability:factor={factor}'])
        (seen,) = simulate(rig, announced(rig), [900.0], effects=effects, **setting)
        return float((seen**2).sum())

    found = gradient(
        rig,
        announced(rig),
        [900.0],
        lambda _index, seen: (float((seen**2).sum()), 2.0 * seen),
        effects=parse_effects(['permeability:factor=1.1']),
        parameters=[('permeability', 'factor')],
        **setting,
    )
    slope = (cost(1.1 + 1e-6) - cost(1.1 - 1e-6)) / 2e-6
    assert found.parameters[0] == pytest.approx(slope, rel=1e-3)
