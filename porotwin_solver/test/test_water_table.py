"""The water table in the sand, compared with Dupuit's and Charny's exact discharges."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY, ML_H
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_solver.adjoint import gradient
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.effects import EFFECTS, parse_effect
from porotwin_solver.flow.water_table import TableFlow
from porotwin_solver.model.engine import State
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate

CONDUCTIVITY = 6.57e-10 * 998.0 * GRAVITY / 1e-3
DEPTH, WIDTH, HIGH, LOW = 0.010, 0.934, 0.45, 0.25


def tank(make_rig, *, fringe: float = 0.0, low: float = LOW, width: float = WIDTH, **more) -> Rig:
    water = {'high': {'side': 'left', 'head_m': HIGH}, 'low': {'side': 'right', 'head_m': low}}
    return make_rig(
        boundaries={'top': 'closed'},
        width_m=width,
        control=None,
        water={**water, **more},
        water_table={'fringe_m': fringe},
    )


def table_of(rig: Rig, nx: int, nz: int) -> TableFlow:
    grid = rig.grid(nx, nz)
    return TableFlow(nominal_physics(rig, grid), np.zeros(grid.shape))


def test_the_discharge_between_two_levels_is_charnys(make_rig) -> None:
    """q = K (h1^2 - h2^2) / (2 L), exact with a seepage face (Charny 1951; Bear 1972, sec. 8.1)."""
    exact = CONDUCTIVITY * DEPTH * (HIGH**2 - LOW**2) / (2.0 * WIDTH)
    errors = []
    for nx, nz in ((40, 24), (80, 48)):
        flux = table_of(tank(make_rig), nx, nz).flux
        np.testing.assert_allclose(flux.x.sum(axis=0), flux.x[:, 0].sum(), rtol=1e-6)
        errors.append(abs(flux.x[:, 0].sum() / exact - 1.0))
    assert errors[1] < 0.01
    assert errors[1] < errors[0] + 1e-3


def test_rain_makes_dupuits_parabola(make_rig) -> None:
    """h^2 = h1^2 - (h1^2 - h2^2) x / L + N x (L - x) / K (Bear 1972, sec. 8.2)."""
    rate = 200.0
    rain = {'rain': {'side': 'top', 'rate_ml_h': rate}}
    rig = tank(make_rig, low=0.40, **rain)
    table = table_of(rig, 80, 48)
    recharge = rate * ML_H / (WIDTH * DEPTH)
    x = table.physics.grid.x
    exact = HIGH**2 - (HIGH**2 - 0.40**2) * x / WIDTH + recharge / CONDUCTIVITY * x * (WIDTH - x)
    divide = WIDTH / 2.0 - CONDUCTIVITY * (HIGH**2 - 0.40**2) / (2.0 * recharge * WIDTH)
    wet = np.clip(table.surface.sum(axis=0) * table.physics.grid.dz, 0.0, None)
    np.testing.assert_allclose(wet, np.sqrt(exact), atol=0.008)
    out = -table.flux.x[:, 0].sum() + table.flux.x[:, -1].sum()
    assert out == pytest.approx(rate * ML_H, rel=1e-9)
    assert -table.flux.x[:, 0].sum() / (rate * ML_H) == pytest.approx(divide / WIDTH, abs=0.01)


def test_a_fringe_carries_water_above_the_table(make_rig) -> None:
    """The sand is full to h + b: q = K ((h1 + b)^2 - (h2 + b)^2) / (2 L) in Dupuit's flow.

    At its ends this water bends below the level of the water, which matters less in a long tank.
    """
    low, fringe = 0.43, 0.06
    plain, raised = (
        float(table_of(tank(make_rig, low=low, fringe=b, width=4.0), 100, 48).flux.x[:, 20].sum())
        for b in (0.0, fringe)
    )
    expected = (HIGH + low + 2.0 * fringe) / (HIGH + low)
    assert raised / plain == pytest.approx(expected, rel=0.004)


def test_no_water_moves_in_dry_sand_and_every_cell_balances(make_rig) -> None:
    table = table_of(tank(make_rig), 60, 36)
    flux = table.flux
    through = float(flux.x[:, 0].sum())
    np.testing.assert_allclose(flux.divergence(), 0.0, atol=1e-10 * through)
    dry = table.surface == table.surface.min()
    assert dry.any()
    assert np.abs(flux.x[:, 1:][dry]).max() < 1e-4 * through
    assert (np.diff(table.surface.sum(axis=0)) <= 1e-6).all()  # it falls to the right


def test_a_table_above_the_sand_is_full_sand(make_rig) -> None:
    water = {'high': {'side': 'left', 'head_m': 0.72}, 'low': {'side': 'right', 'head_m': 0.70}}
    rig = make_rig(boundaries={'top': 'closed'}, control=None, water=water)
    below = rig.model_copy(update={'water_table': tank(make_rig).water_table})
    full = Model(rig, rig.grid(31, 17), preset='fast').engine.water_flux({})
    found = Model(below, rig.grid(31, 17), preset='fast').engine.water_flux({})
    np.testing.assert_allclose(found.x, full.x, rtol=1e-8)


@pytest.mark.parametrize('preset', ['fast', 'accurate'])
def test_tracer_is_conserved_below_a_table(make_rig, preset) -> None:
    rain = {'rain': {'side': 'top', 'to_m': 0.5, 'rate_ml_h': 100.0, 'concentration': 0.5}}
    rig = tank(make_rig, low=0.40, fringe=0.03, **rain)
    model = Model(rig, rig.grid(30, 18), preset=preset)
    engine, rates = model.engine, {'injector': WellRate(100.0 * ML_H, 1.0)}
    state, entered = State.equilibrium(np.zeros(engine.grid.shape)), 0.0
    for coefficients in engine.interval(state, rates, 1200.0):
        engine.step(state, coefficients)
        entered += 2.0 * coefficients.exchanges.levels.duration * coefficients.sources.tracer.sum()
    held = float((engine.storage * state.mobile).sum())
    assert held + state.tracer_lost.sum() == pytest.approx(entered, rel=1e-10)
    assert state.mobile.min() >= -1e-12
    assert state.mobile.max() <= 1.0 + 1e-12


def test_the_adjoint_knows_that_rates_levels_and_fringes_move_the_table(make_rig) -> None:
    rig = tank(make_rig, low=0.40, fringe=0.03)
    grid, times = rig.grid(31, 19), [900.0]
    weights = np.random.default_rng(3).random(grid.shape)

    def schedule(rate: float) -> Schedule:
        return Schedule((ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),))

    def changed(rise: float, fringe: float) -> list:
        texts = f'water_body:body=high,rise={float(rise)!r}', f'fringe:rise={float(fringe)!r}'
        return [parse_effect(text) for text in texts]

    def cost(rate: float, rise: float, fringe: float) -> float:
        effects = changed(rise, fringe)
        (seen,) = simulate(rig, schedule(rate), times, effects=effects, grid=grid, preset='upwind')
        return float((weights * seen**2).sum())

    at = np.array([250.0 * ML_H, 0.002, 0.004])
    found = gradient(
        rig,
        schedule(at[0]),
        times,
        lambda _index, seen: (float((weights * seen**2).sum()), 2.0 * weights * seen),
        grid=grid,
        preset='upwind',
        effects=changed(*at[1:]),
        parameters=[('water_body', 'rise'), ('fringe', 'rise')],
    )
    steps = np.array([1e-5 * at[0], 1e-7, 1e-7])
    slopes = [
        (cost(*(at + step)) - cost(*(at - step))) / (2.0 * step.sum()) for step in np.diag(steps)
    ]
    assert found.rate['injector'][0] == pytest.approx(slopes[0], rel=1e-3)
    assert found.parameters == pytest.approx(slopes[1:], rel=1e-3)


def test_a_fringe_in_full_sand_is_refused(make_rig) -> None:
    rig = make_rig()
    with pytest.raises(InputError, match='give water_table'):
        Model(rig, rig.grid(20, 12), effects=[parse_effect('fringe:rise=0.01')])


def test_a_flow_through_all_sides_is_refused_beside_a_table(make_rig) -> None:
    rig = tank(make_rig)
    model = Model(rig, rig.grid(20, 12), effects=[parse_effect('background_flow:x_velocity=1e-6')])
    with pytest.raises(InputError, match='use water_body'):
        model.predict(model.initial_condition(), {}, 60.0)
    assert EFFECTS['background_flow'].believed(rig) == []
