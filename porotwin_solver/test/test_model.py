"""The model as the twin asks it: consistent, bounded, conservative, and clear about bad input."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from porotwin_core.errors import InputError
from porotwin_core.rig import Boundaries, EffectDescription, MapReference, Rig, Well
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, WellRate, net_rate
from porotwin_solver.effects import EFFECTS
from porotwin_solver.engine import Engine, State
from porotwin_solver.model import PRESETS, Model
from porotwin_solver.physics import nominal_physics
from porotwin_solver.quantities import QUANTITIES
from porotwin_solver.refinement import coarsen, refine
from porotwin_solver.simulation import simulate, simulated_maps
from porotwin_solver.transport import SUPERBEE, THIRD_ORDER, UPWIND

SIDES = {
    'open top': Boundaries(),
    'closed': Boundaries(top='closed'),
    'open': Boundaries(top='open', bottom='open', left='open', right='open'),
}
EXAMPLES = {
    'numerical_diffusion': {'model_diffusion': 1e-7},
    'dispersion': {
        'longitudinal_dispersivity': 0.005,
        'transverse_dispersivity': 0.0004,
        'diffusion': 2e-9,
    },
    'buoyancy': {'density_difference': 0.8},
    'viscosity': {'viscosity_ratio': 1.4},
    'retardation': {'retardation_factor': 1.2},
    'decay': {'rate': 1e-4},
    'dual_porosity': {'immobile_fraction': 0.1, 'exchange_rate': 4e-4},
    'heterogeneity': {'x': 0.3, 'z': 0.3, 'radius': 0.07, 'permeability_factor': 0.02},
    'porosity': {'factor': 0.9},
    'depth': {'factor_centre': 1.1},
    'rate': {'well': 'injector', 'factor': 0.95},
    'well_position': {'well': 'injector', 'dx': 0.004, 'dz': -0.003},
    'leak': {'x': 0.4, 'z': 0.3, 'rate': -40.0},
    'background_flow': {'x_velocity': 1e-6, 'z_velocity': 4e-7},
    'saturation': {'exponent': 1.5},
    'illumination': {'drift': -5e-5, 'gradient': 0.1},
    'registration': {'dx': 0.004, 'dz': -0.01, 'rotation': 0.01, 'scale': 1.01},
    'clock': {'offset': 100.0},
}
"""Every effect with parameters of a plausible size."""

PHYSICS = [name for name in EXAMPLES if EFFECTS[name].on_physics is not None]


def described(name: str) -> EffectDescription:
    """Return an effect with the parameters of EXAMPLES."""
    return EffectDescription(name=name, parameters=EXAMPLES[name])


def rough_map(shape: tuple[int, int], seed: int) -> np.ndarray:
    """Return values between 0 and 1 with plateaus, jumps and noise."""
    rng = np.random.default_rng(seed)
    return np.clip(rng.normal(0.5, 0.8, shape), 0.0, 1.0)


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('effect', [None, *PHYSICS])
def test_correct_undoes_residual_to_round_off(rig, rates, preset, effect) -> None:
    model = Model(
        rig, rig.grid(31, 19), preset=preset, effects=[described(effect)] if effect else []
    )
    before, after = rough_map((19, 31), 1), rough_map((19, 31), 2)
    sigma = model.residual(before, after, rates, 30.0)
    corrected = model.correct(before, sigma, rates, 30.0)
    np.testing.assert_allclose(corrected, after, atol=2e-15)


def test_the_residual_of_a_prediction_is_zero(rig, rates) -> None:
    model = Model(rig, rig.grid(31, 19), preset='fast')
    before = rough_map((19, 31), 3)
    after = model.predict(before, rates, 30.0)
    assert np.abs(model.residual(before, after, rates, 30.0)).max() == 0.0


def test_the_operator_tends_to_its_differential_form(rig, rates) -> None:
    """phi (c - P c_prev) / dt tends to phi dc/dt + div(q c) - f_c for a smooth map and small dt."""
    grid = rig.grid(187, 112)
    model = Model(rig, grid, preset='fast')
    x, z = grid.x[None, :], grid.z[:, None]
    smooth = 0.5 + 0.4 * np.sin(7.0 * x) * np.cos(9.0 * z)
    flux = model.engine.flux(rates)
    vx = 0.5 * (flux.x[:, :-1] + flux.x[:, 1:]) / (0.010 * grid.dz)
    vz = 0.5 * (flux.z[:-1] + flux.z[1:]) / (0.010 * grid.dx)
    expected = vx * 2.8 * np.cos(7.0 * x) * np.cos(9.0 * z) - vz * 3.6 * np.sin(7.0 * x) * np.sin(
        9.0 * z
    )
    found = model.residual(smooth, smooth, rates, 0.01)
    away = np.ones(grid.shape, dtype=bool)
    for well in rig.wells.values():
        away &= np.hypot(x - well.x_m, z - well.z_m) > 0.03
    away[:2] = away[-2:] = away[:, :2] = away[:, -2:] = False
    scale = np.abs(expected[away]).max()
    assert np.abs(found - expected)[away].max() < 0.05 * scale
    assert np.abs(found - expected)[away].mean() < 0.005 * scale


UNBALANCED = {('closed', 'rate'), ('closed', 'leak')}
"""Effects that a rig without an open side refuses."""


@pytest.mark.parametrize(
    ('sides', 'effect'),
    [pair for pair in itertools.product(SIDES, [None, *PHYSICS]) if pair not in UNBALANCED],
)
@pytest.mark.parametrize('preset', PRESETS)
def test_the_tracer_is_conserved(make_rig, preset, sides, effect) -> None:
    """What is there, what came in and what left add up, to 1e-12 of what moved."""
    rig = make_rig(boundaries=SIDES[sides])
    rates = {
        'injector': WellRate(from_ml_h(500.0), 0.9),
        'control1': WellRate(from_ml_h(100.0), 0.0),
        'producer': WellRate(from_ml_h(-600.0)),
    }
    grid = rig.grid(31, 19)
    model = Model(rig, grid, preset=preset, effects=[described(effect)] if effect else [])
    engine = model.engine
    state = State.at_rest(refine(rough_map((19, 31), 4), engine.grid.shape))
    storage = engine.physics.storage
    begin = math.fsum((storage * engine.seen(state)).ravel())
    engine.advance(state, rates, 90.0)
    end = math.fsum((storage * engine.seen(state)).ravel())
    injected = 90.0 * math.fsum(engine.sources_and_sinks.sources(rates).tracer.ravel())
    if effect == 'decay':
        assert end + state.left.sum() < begin + injected
        return
    balance = begin + injected - end - state.left.sum()
    assert abs(balance) < 1e-12 * (begin + injected)
    assert state.left[0] > 0.0


def test_decay_takes_what_it_should(rig, rates) -> None:
    """d(tracer)/dt = injected - rate * tracer, while nothing leaves the rig."""
    model = Model(rig, rig.grid(93, 56), preset='fast', effects=[described('decay')])
    state = State.at_rest(model.initial_condition())
    model.engine.advance(state, rates, 1200.0)
    injected = rates['injector'].rate
    expected = injected / 1e-4 * (1.0 - math.exp(-1e-4 * 1200.0))
    assert model.quantity_of_interest('tracer_volume', state.mobile) == pytest.approx(
        expected,
        rel=1e-5,  # Strang splitting, steps of 60 s
    )


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    decades=st.floats(0.0, 4.0),
    told=st.lists(st.floats(-900.0, 900.0), min_size=5, max_size=5),
    step=st.floats(0.1, 900.0),
    preset=st.sampled_from(sorted(PRESETS)),
    effect=st.sampled_from([None, 'dispersion', 'buoyancy', 'viscosity', 'dual_porosity']),
    sides=st.sampled_from(sorted(SIDES)),
)
def test_no_value_leaves_the_range_of_what_is_there_and_what_comes(
    make_rig, tmp_path_factory, seed, decades, told, step, preset, effect, sides
) -> None:
    rng = np.random.default_rng(seed)
    rig = make_rig(boundaries=SIDES[sides])
    names = list(rig.wells)
    if sides == 'closed':
        told[-1] = -math.fsum(told[:-1])
    rates = {
        name: WellRate(from_ml_h(rate), float(rng.random()))
        for name, rate in zip(names, told, strict=True)
    }
    rig = with_permeability(rig, 6.57e-10 * 10 ** rng.uniform(-decades, 0.0, (13, 17)))
    grid = rig.grid(17, 13)
    model = Model(rig, grid, preset=preset, effects=[described(effect)] if effect else [])
    found = model.predict(rough_map(grid.shape, seed), rates, step)
    assert found.min() >= -1e-13
    assert found.max() <= 1.0 + 1e-13


def with_permeability(rig: Rig, values: np.ndarray) -> Rig:
    """Return `rig` with a permeability map [m^2], (nz, nx)."""
    changed = rig.model_copy(
        update={'permeability_m2': MapReference(file='permeability.nc', variable='permeability')}
    )
    changed._maps = {**rig._maps, 'permeability_m2': values}
    return changed


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('effect', [None, 'dispersion', 'viscosity', 'dual_porosity'])
def test_a_mirrored_rig_gives_the_mirrored_map(make_rig, preset, effect) -> None:
    wells = {'injector': Well(x_m=0.3, z_m=0.2), 'producer': Well(x_m=0.7, z_m=0.4)}
    mirrored = {name: Well(x_m=0.934 - well.x_m, z_m=well.z_m) for name, well in wells.items()}
    rates = {
        'injector': WellRate(from_ml_h(500.0), 1.0),
        'producer': WellRate(from_ml_h(-400.0)),
    }
    effects = [described(effect)] if effect else []
    schedule = Schedule.constant(rates)
    maps = []
    for sources_and_sinks in (wells, mirrored):
        rig = make_rig(wells=sources_and_sinks)
        maps.append(
            simulate(rig, schedule, [900.0], grid=rig.grid(47, 28), preset=preset, effects=effects)
        )
    np.testing.assert_allclose(maps[0][0], maps[1][0][:, ::-1], atol=2e-8)


def test_a_larger_step_is_stable_and_close_to_small_ones(rig, rates) -> None:
    """One photograph interval of 300 s against ten of 30 s."""
    model = Model(rig, rig.grid(93, 56), preset='fast')
    start = model.predict(model.initial_condition(), rates, 600.0)
    small = start
    for _ in range(10):
        small = model.predict(small, rates, 30.0)
    large = model.predict(start, rates, 300.0)
    assert np.linalg.norm(large - small) < 0.02 * np.linalg.norm(small)


def test_predictions_follow_each_other_like_a_simulation(rig, rates) -> None:
    grid = rig.grid(47, 28)
    model = Model(rig, grid, preset='fast')
    state = model.initial_condition()
    for _ in range(4):
        state = model.predict(state, rates, 30.0)
    maps = simulate(
        rig, Schedule.constant(rates), [30.0, 60.0, 90.0, 120.0], grid=grid, preset='fast'
    )
    np.testing.assert_allclose(maps[-1], state, atol=1e-14)


def test_refining_and_averaging_returns_the_map() -> None:
    coarse = rough_map((11, 14), 6)
    fine = refine(coarse, (33, 42))
    np.testing.assert_allclose(coarsen(fine, (11, 14)), coarse, atol=1e-15)
    assert fine.min() >= 0.0
    assert fine.max() <= 1.0


def test_the_injected_volume_is_found_again(rig, rates) -> None:
    model = Model(rig, rig.grid(93, 56), preset='fast')
    found = model.predict(model.initial_condition(), rates, 600.0)
    volume = model.quantity_of_interest('tracer_volume', found)
    assert volume == pytest.approx(600.0 * rates['injector'].rate, rel=1e-12)
    assert model.quantity_of_interest('max_concentration', found) == pytest.approx(1.0)
    assert model.quantity_of_interest('plume_centroid_x', found) == pytest.approx(0.235, abs=0.02)
    assert model.quantity_of_interest('plume_centroid_z', found) == pytest.approx(0.235, abs=0.02)
    area = 600.0 * rates['injector'].rate / (0.010 * 0.375)
    assert model.quantity_of_interest('plume_area', found) == pytest.approx(area, rel=0.3)
    assert math.isnan(model.quantity_of_interest('plume_centroid_x', np.zeros((56, 93))))


def test_local_steps_give_what_a_common_step_gives(rig, rates) -> None:
    """The levels of the cells change the order of events, hardly the result."""
    physics = nominal_physics(rig, rig.grid(93, 56))
    for scheme in (UPWIND, SUPERBEE, THIRD_ORDER):
        engine = Engine(physics, scheme=scheme)
        local = State.at_rest(np.zeros(physics.grid.shape))
        common = local.copy()
        engine.advance(local, rates, 600.0)
        for _ in range(600):  # so small that nearly all cells take one step each
            engine.advance(common, rates, 1.0)
        change = np.linalg.norm(local.mobile - common.mobile) / np.linalg.norm(common.mobile)
        assert change < 0.05, f'scheme {scheme}: {change}'


def refusals(rig: Rig) -> dict[str, tuple]:
    """Return, by what the message must say, a call that must be refused."""
    grid = rig.grid(17, 11)
    model = Model(rig, grid, preset='fast')
    closed = Model(rig.model_copy(update={'boundaries': SIDES['closed']}), grid, preset='fast')
    empty = model.initial_condition()
    holes = empty.copy()
    holes[3, 4] = math.nan

    def effect(name: str, **parameters):
        return lambda: Model(
            rig, grid, effects=[EffectDescription(name=name, parameters=parameters)]
        )

    one = {'injector': WellRate(1e-7, 1.0)}
    return {
        r'concentration: 1 cells are not finite': lambda: model.predict(holes, {}, 30.0),
        r'sigma: 1 cells are not finite': lambda: model.correct(empty, holes, {}, 30.0),
        r'next: a map of \(3, 3\) cells, the model has \(11, 17\)': lambda: model.residual(
            empty, np.zeros((3, 3)), {}, 30.0
        ),
        r'time step 0 s: must be positive': lambda: model.predict(empty, {}, 0),
        r'time step nan s: must be positive': lambda: model.predict(empty, {}, math.nan),
        r"unknown well 'pump'; known: injector, producer": lambda: model.predict(
            empty, {'pump': WellRate(1e-7)}, 30.0
        ),
        r'rates add up to 360 ml/h in a rig whose sides are all closed': lambda: closed.predict(
            empty, one, 30.0
        ),
        r"preset 'quick': unknown; choose from fast, accurate": lambda: Model(
            rig, grid, preset='quick'
        ),
        r"quantity 'colour': unknown; choose from tracer_volume": lambda: (
            model.quantity_of_interest('colour', empty)
        ),
        r'grid of 1.0 m x 0.5 m: rig .small. measures 0.934 m x 0.562 m': lambda: Model(
            rig, type(grid)(17, 11, 1.0, 0.5)
        ),
        r'permeability -1e-10: must be positive everywhere': lambda: Model(
            with_permeability(rig, np.full((11, 17), -1e-10)), grid
        ),
        r"effect 'magic': unknown; choose from background_flow": effect('magic'),
        r"effect decay: unknown parameter 'speed'; known: rate": effect('decay', speed=1.0),
        r"effect decay: parameter 'rate' \[1/s\] is missing": effect('decay'),
        r'effect decay: rate = -1: must be at least 0': effect('decay', rate=-1.0),
        r'effect viscosity: viscosity_ratio = 0: must be greater than 0': effect(
            'viscosity', viscosity_ratio=0.0
        ),
        r"effect porosity: factor = 'much': give a number": effect('porosity', factor='much'),
        r'porosity 1.125: must not exceed 1': effect('porosity', factor=3.0),
        r'effect porosity: factor = -0.5: must be greater than 0': effect('porosity', factor=-0.5),
        r"unknown well 'pump'; known": effect('rate', well='pump', factor=0.9),
        r'effect rate: well = 3.0: give a name': effect('rate', well=3.0, factor=0.9),
        r'leak 1 at \(2, 0.1\) m lies outside the rig': effect('leak', x=2.0, z=0.1, rate=1.0),
        r"well 'producer' at \(1.66, 0.16\) m lies outside the rig": effect(
            'well_position', well='producer', dx=1.0
        ),
        r'times: give finite seconds that do not decrease': lambda: simulate(
            rig, Schedule(), [30.0, 0.0], grid=grid
        ),
    }


@pytest.mark.parametrize('number', range(24))
def test_bad_input_gets_one_line_with_thing_value_and_remedy(rig, number) -> None:
    listed = [(text, call) for text, call in refusals(rig).items() if call is not None]
    text, call = listed[number]
    with pytest.raises(InputError, match=text) as refusal:
        call()
    assert '\n' not in str(refusal.value)


def test_every_refusal_is_tested(rig) -> None:
    assert len([call for call in refusals(rig).values() if call is not None]) == 24


def test_balanced_rates_are_welcome_in_a_closed_rig(make_rig, rates) -> None:
    rig = make_rig(boundaries=SIDES['closed'])
    assert net_rate(rates) == pytest.approx(0.0, abs=1e-20)
    model = Model(rig, rig.grid(17, 11), preset='fast')
    assert model.predict(model.initial_condition(), rates, 30.0).max() > 0.0


def test_all_quantities_have_a_unit_and_a_value(rig) -> None:
    model = Model(rig, rig.grid(17, 11), preset='fast')
    for name, (unit, _) in QUANTITIES.items():
        assert unit
        assert math.isfinite(model.quantity_of_interest(name, np.full((11, 17), 0.5)))


def test_cells_can_be_divided_further_than_the_preset_does(make_rig) -> None:
    rig = make_rig()
    coarse, fine = rig.grid(24, 14), rig.grid(72, 42)
    told = Schedule.constant({'injector': WellRate(from_ml_h(600.0), 1.0)})
    divided = simulated_maps(rig, told, [900.0], grid=coarse, preset='fast', divisions=3)
    finer = simulated_maps(rig, told, [900.0], grid=fine, preset='fast')
    np.testing.assert_allclose(next(divided), coarsen(next(finer), coarse.shape), atol=1e-12)
