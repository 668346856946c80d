"""Water at a part of the sand, compared with exact solutions, balances and finite differences."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk, erfc

from porotwin_core.basis.units import GRAVITY, ML_H, from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig
from porotwin_solver.adjoint import gradient
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.coefficients.water_contact import contact_of, entering
from porotwin_solver.effects import parse_effect
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.model.model import Model
from porotwin_solver.model.simulation import simulate
from porotwin_solver.transport.scheme import Scheme

CLOSED = {'top': 'closed'}
CONDUCTIVITY = 6.57e-10 * 998.0 * GRAVITY / 1e-3
"""Of the sand of the paper [m/s]."""
DEPTH = 0.010
POLYGON = [[0.40, 0.40], [0.55, 0.40], [0.55, 0.5], [0.40, 0.5]]


def tank(make_rig, water: dict, **others) -> Rig:
    return make_rig(boundaries=CLOSED, control=None, water=water, **others)


def inflow(rig: Rig, nx: int, nz: int) -> float:
    """Return the rate [m^3/s] at which water enters through outer faces without the wells."""
    flux = background_flux(nominal_physics(rig, rig.grid(nx, nz)))
    return sum(float(np.maximum(side, 0.0).sum()) for side in entering(flux))


def test_a_body_along_a_whole_side_is_an_open_side(make_rig) -> None:
    heads = {'left': 0.62, 'right': 0.6}
    sides = make_rig(
        boundaries={**CLOSED, 'left': 'open', 'right': 'open', 'heads_m': heads}, control=None
    )
    bodies = tank(make_rig, {name: {'side': name, 'head_m': head} for name, head in heads.items()})
    one, other = (background_flux(nominal_physics(r, r.grid(31, 17))) for r in (sides, bodies))
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.z, other.z)
    assert not bodies.closed


@pytest.mark.parametrize('share', [0.3, 0.5])
def test_the_rate_between_parts_of_two_sides_is_that_of_a_conformal_map(make_rig, share) -> None:
    """Water enters at the lower `share` of the left side and leaves at the whole right side.

    The rectangle is mapped to a half plane by sn, and this one to the rectangle of another modulus,
    through which the flow is uniform (Polubarinova-Kochina, Theory of Ground Water Movement, ch. 4;
    the modulus of a quadrilateral, as in Henrici, Applied and Computational Complex Analysis III,
    sec. 16.11).
    """
    width, height = 1.0, 0.5
    water = {
        'high': {'side': 'left', 'to_m': share * height, 'head_m': 0.52},
        'low': {'side': 'right', 'head_m': 0.5},
    }
    rig = tank(make_rig, water, width_m=width, height_m=height, wells={})
    expected = CONDUCTIVITY * 0.02 * DEPTH * shape_factor(width, height, share)
    coarse, fine = (inflow(rig, 2 * n, n) for n in (50, 100))
    assert fine == pytest.approx(expected, rel=0.012)
    assert abs(fine - expected) < 0.6 * abs(coarse - expected)


def shape_factor(width: float, height: float, share: float) -> float:
    """Return rate / (conductivity depth fall) of the rectangle, by the modulus of its image.

    The map u = sn((x + i z') K / width) takes the rectangle 0 < x < K, 0 < z' < K' to a quadrant.
    """
    # mirrored below the closed bottom: the left side is -K < s < K, the right one i K'
    m = brentq(lambda m: ellipk(1.0 - m) / ellipk(m) - width / height, 1e-12, 1.0 - 1e-12)
    sn, _, _, _ = ellipj(share * ellipk(m), m)
    # half plane: the canal is |u| < sn, the right side |u| > 1 / sqrt(m)
    k = sn * math.sqrt(m)
    return float(ellipk(k**2) / ellipk(1.0 - k**2))


def test_flow_from_a_canal_follows_the_conformal_map(make_rig) -> None:
    """A narrow canal in deep sand: the potential falls with the logarithm of the distance.

    A strip of half width a at the surface of a half plane has equipotentials that are ellipses of
    the half axes a cosh v and a sinh v: q = pi K fall / arcsinh(r / a) (Harr, Groundwater and
    Seepage, sec. 7-3). The sides of the rig hold the potentials of that solution.
    """
    half = 0.05
    water = {
        'strip': {'side': 'top', 'from_m': 0.5 - half, 'to_m': 0.5 + half, 'head_m': 0.6},
        'rim': {'corners_m': ring(half, 0.30), 'head_m': 0.5},
    }
    rig = tank(make_rig, water, width_m=1.0, height_m=0.5, wells={})
    v = math.asinh(0.30 / half)
    expected = math.pi * CONDUCTIVITY * DEPTH * 0.1 / v
    assert inflow(rig, 160, 80) == pytest.approx(expected, rel=0.025)


def ring(half: float, depth: float) -> list[tuple[float, float]]:
    """Return the sand outside the ellipse with the foci of the strip that reaches to `depth`."""
    angle = np.linspace(0.0, math.pi, 181)
    axis = math.hypot(half, depth)
    inner = [
        (
            0.5 + axis * math.cos(a),
            0.5 - depth * math.sin(a) + 0.001 * (a in (0.0, math.pi)),
        )
        for a in angle
    ]
    return [*inner, (-0.01, 0.51), (-0.01, -0.01), (1.01, -0.01), (1.01, 0.51)]


def test_rain_is_the_given_rate_and_leaves_where_water_has_a_head(make_rig) -> None:
    water = {
        'rain': {'side': 'top', 'from_m': 0.2, 'to_m': 0.5, 'rate_ml_h': 300.0},
        'ditch': {'corners_m': POLYGON, 'head_m': 0.5},
    }
    rig = tank(make_rig, water)
    physics = nominal_physics(rig, rig.grid(41, 23))
    flux = background_flux(physics)
    assert -flux.z[-1].sum() == pytest.approx(300.0 * ML_H, rel=1e-12)
    outflow = flux.divergence()
    canal = physics.contact.canal
    np.testing.assert_allclose(outflow[~canal], 0.0, atol=1e-12 * 300.0 * ML_H)
    assert outflow[canal].sum() == pytest.approx(-300.0 * ML_H, rel=1e-9)


def test_dense_water_stands_still_in_sand_that_is_full_of_it(make_rig) -> None:
    water = {
        'sea': {'side': 'left', 'head_m': 0.6, 'concentration': 1.0},
        'pond': {'corners_m': POLYGON, 'head_m': 0.6, 'concentration': 1.0},
    }
    rig = tank(
        make_rig, water, effects=({'name': 'buoyancy', 'parameters': {'density_difference': 25.0}},)
    )
    model = Model(rig, rig.grid(30, 18), preset='fast')
    engine = model.engine
    state = State.equilibrium(np.ones(engine.grid.shape))
    flux = engine.coefficients(state, {}, 60.0).flux
    moving = engine.water_flux({})
    assert np.abs(moving.x).max() > 1e-9
    for part in flux:
        np.testing.assert_allclose(part, 0.0, atol=1e-9 * np.abs(moving.x).max())


@pytest.mark.parametrize('concentration', [0.0, 0.4, 1.0])
def test_sand_full_of_the_water_that_enters_stays_as_it_is(make_rig, concentration) -> None:
    water = {
        'high': {'side': 'left', 'from_m': 0.2, 'head_m': 0.6, 'concentration': concentration},
        'low': {'corners_m': POLYGON, 'head_m': 0.58, 'concentration': concentration},
        'rain': {'side': 'top', 'to_m': 0.3, 'rate_ml_h': 200.0, 'concentration': concentration},
    }
    rig = tank(make_rig, water)
    model = Model(rig, rig.grid(41, 25), preset='fast')
    after = model.predict(np.full(model.grid.shape, concentration), {}, 600.0)
    np.testing.assert_allclose(after, concentration, atol=1e-12)


@pytest.mark.parametrize(
    'effects', [(), ('buoyancy:density_difference=8', 'viscosity:viscosity_ratio=1.3')]
)
@pytest.mark.parametrize('preset', ['fast', 'accurate'])
def test_tracer_is_conserved_between_wells_canals_and_rain(make_rig, effects, preset) -> None:
    water = {
        'high': {'side': 'left', 'from_m': 0.3, 'head_m': 0.58, 'concentration': 0.6},
        'low': {'corners_m': POLYGON, 'head_m': 0.57},
        'rain': {'side': 'top', 'to_m': 0.3, 'rate_ml_h': 200.0, 'concentration': 0.8},
    }
    rig = tank(make_rig, water)
    model = Model(rig, rig.grid(30, 18), preset=preset, effects=[parse_effect(e) for e in effects])
    engine, rates = model.engine, {'injector': WellRate(from_ml_h(300.0), 1.0)}
    state = State.equilibrium(np.zeros(engine.grid.shape))
    entered = 0.0
    for coefficients in engine.interval(state, rates, 900.0):
        engine.step(state, coefficients)
        entered += 2.0 * coefficients.exchanges.levels.duration * coefficients.sources.tracer.sum()
    held = float((engine.storage * state.mobile).sum())
    assert entered > 0.0
    assert held + state.tracer_lost.sum() == pytest.approx(entered, rel=1e-11)
    assert state.mobile.min() >= -1e-12
    assert state.mobile.max() <= 1.0 + 1e-12


@pytest.mark.parametrize(
    'effects',
    [
        (),
        (
            'buoyancy:density_difference=6',
            'dispersion:longitudinal_dispersivity=4e-3,transverse_dispersivity=1e-3',
        ),
        ('buoyancy:density_difference=2', 'viscosity:viscosity_ratio=1.3'),
    ],
)
def test_the_adjoint_knows_rates_levels_and_rain(make_rig, effects) -> None:
    water = {
        'high': {'side': 'left', 'from_m': 0.3, 'head_m': 0.571, 'concentration': 0.6},
        'low': {'corners_m': POLYGON, 'head_m': 0.57, 'concentration': 0.2},
        'rain': {'side': 'top', 'to_m': 0.3, 'rate_ml_h': 200.0, 'concentration': 0.8},
    }
    rig = tank(make_rig, water)
    grid, times = rig.grid(31, 19), [600.0]
    weights = np.random.default_rng(3).random(grid.shape)
    described = [parse_effect(effect) for effect in effects]

    def schedule(rate: float) -> Schedule:
        return Schedule((ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),))

    def changed(rise: float, factor: float) -> list:
        return [
            *described,
            parse_effect(f'water_body:body=high,rise={rise}'),
            parse_effect(f'water_body:body=rain,factor={factor}'),
        ]

    def cost(rate: float, rise: float, factor: float) -> float:
        (seen,) = simulate(
            rig, schedule(rate), times, effects=changed(rise, factor), grid=grid, preset='upwind'
        )
        return float((weights * seen**2).sum())

    at = np.array([300.0 * ML_H, 0.0005, 1.1])
    found = gradient(
        rig,
        schedule(at[0]),
        times,
        lambda _index, seen: (float((weights * seen**2).sum()), 2.0 * weights * seen),
        grid=grid,
        preset='upwind',
        effects=changed(at[1], at[2]),
        parameters=[('water_body', 'rise')],
    )
    steps = np.array([1e-5 * at[0], 1e-7, 1e-5])
    slopes = [
        (cost(*(at + step)) - cost(*(at - step))) / (2.0 * step.sum()) for step in np.diag(steps)
    ]
    assert found.rate['injector'][0] == pytest.approx(slopes[0], rel=1e-4)
    assert found.parameters[0] == pytest.approx(slopes[1], rel=1e-4)


def test_a_canal_smaller_than_a_cell_has_one_cell(make_rig) -> None:
    water = {'drain': {'corners_m': [[0.5, 0.3], [0.502, 0.3], [0.501, 0.302]], 'head_m': 0.5}}
    rig = tank(make_rig, water)
    assert contact_of(rig.grid(20, 12), rig.water_bodies).canal.sum() == 1


def test_the_upwind_scheme_knows_the_exact_front_of_dense_water(make_rig) -> None:
    """Without gravity a front in one dimension moves with the pore velocity."""
    water = {
        'in': {'side': 'left', 'head_m': 0.62, 'concentration': 1.0},
        'out': {'side': 'right', 'head_m': 0.60},
    }
    rig = tank(make_rig, water)
    physics = nominal_physics(rig, rig.grid(60, 10))
    engine = Engine(physics, scheme=Scheme.SUPERBEE)
    state = State.equilibrium(np.zeros(physics.grid.shape))
    speed = CONDUCTIVITY * 0.02 / 0.934 / 0.375
    engine.advance(state, {}, 0.4 / speed)
    np.testing.assert_allclose((state.mobile[5] * physics.grid.dx).sum(), 0.4, rtol=1e-3)


def test_tracer_diffuses_from_a_side_as_into_a_half_space(make_rig) -> None:
    """c = erfc(x / (2 sqrt(D t))) in still water (Crank, The Mathematics of Diffusion, 1975)."""
    water = {'lake': {'side': 'left', 'head_m': 0.6, 'concentration': 1.0, 'diffuses': True}}
    spread = {'longitudinal_dispersivity': 0.0, 'transverse_dispersivity': 0.0, 'diffusion': 1e-6}
    rig = tank(make_rig, water, effects=({'name': 'dispersion', 'parameters': spread},))
    grid, time = rig.grid(94, 4), 900.0
    (found,) = simulate(rig, Schedule(()), [time], grid=grid)
    expected = erfc(grid.x / (2.0 * math.sqrt(spread['diffusion'] * time)))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=0.01)


def test_evaporation_takes_water_from_where_it_has_a_head(make_rig) -> None:
    water = {
        'sun': {'side': 'top', 'to_m': 0.3, 'rate_ml_h': -200.0},
        'pond': {'side': 'right', 'head_m': 0.5},
    }
    rig = tank(make_rig, water)
    flux = background_flux(nominal_physics(rig, rig.grid(41, 23)))
    assert flux.z[-1].sum() == pytest.approx(200.0 * ML_H, rel=1e-12)
    assert -flux.x[:, -1].sum() == pytest.approx(200.0 * ML_H, rel=1e-9)
