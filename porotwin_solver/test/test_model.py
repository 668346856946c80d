"""The model for one interval: consistent, bounded, clear about bad input, frugal."""

import math

import numpy as np
import pytest
from effect_examples import PHYSICAL, described
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from solver_cases import SIDES, rough_map, with_permeability

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, WellRate, net_rate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.model.model import Model
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.model.simulation import simulate


@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('effect', [None, *PHYSICAL])
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


class CountingEngine:
    """An engine that counts the intervals it simulates."""

    def __init__(self, engine) -> None:
        self._engine = engine
        self.intervals = 0

    def __getattr__(self, name: str):
        return getattr(self._engine, name)

    def advance(self, state, rates, duration: float) -> None:
        self.intervals += 1
        self._engine.advance(state, rates, duration)


@pytest.fixture
def counted(rig) -> tuple[Model, CountingEngine]:
    """A model and the count of its simulations."""
    model = Model(rig, rig.grid(31, 19), preset='fast')
    engine = CountingEngine(model.engine)
    model.engine = engine
    return model, engine


def test_correct_uses_the_prediction_that_was_just_made(rig, rates, counted) -> None:
    model, engine = counted
    before, sigma = rough_map((19, 31), 1), 1e-4 * rough_map((19, 31), 2)
    predicted = model.predict(before, rates, 30.0)
    predicted[:] = 0.0  # the caller owns the answer
    corrected = model.correct(before.copy(), sigma, dict(rates), 30.0)
    assert engine.intervals == 1
    fresh = Model(rig, rig.grid(31, 19), preset='fast').correct(before, sigma, rates, 30.0)
    assert corrected.tobytes() == fresh.tobytes()


def test_residual_and_correct_share_one_simulation(rates, counted) -> None:
    model, engine = counted
    before, after = rough_map((19, 31), 1), rough_map((19, 31), 2)
    sigma = model.residual(before, after, rates, 30.0)
    model.correct(before, sigma, rates, 30.0)
    assert engine.intervals == 1


def test_other_arguments_are_simulated_anew(rates, counted) -> None:
    """Also where a map differs in one bit, or was changed in place after the prediction."""
    model, engine = counted
    before, sigma = rough_map((19, 31), 1), np.zeros((19, 31))
    model.predict(before, rates, 30.0)
    nearly = before.copy()
    nearly[3, 4] = np.nextafter(nearly[3, 4], 2.0)
    slower = {**rates, 'control2': WellRate(rates['control2'].rate * (1.0 - 1e-15))}
    for count, (start, pumped, step) in enumerate(
        [(nearly, rates, 30.0), (before, slower, 30.0), (before, rates, 30.000001)], start=2
    ):
        model.correct(start, sigma, pumped, step)
        assert engine.intervals == count
    model.predict(before, rates, 30.0)
    before[3, 4] = 0.123
    model.correct(before, sigma, rates, 30.0)
    assert engine.intervals == 6


def test_predict_always_simulates(rates, counted) -> None:
    model, engine = counted
    before = rough_map((19, 31), 1)
    first, second = (model.predict(before, rates, 30.0) for _ in range(2))
    assert engine.intervals == 2
    np.testing.assert_array_equal(first, second)


def test_the_operator_tends_to_its_differential_form(rig, rates) -> None:
    """phi (c - P c_prev) / dt tends to phi dc/dt + div(q c) - f_c for a smooth map and small dt."""
    grid = rig.grid(187, 112)
    model = Model(rig, grid, preset='fast')
    x, z = grid.x[None, :], grid.z[:, None]
    smooth = 0.5 + 0.4 * np.sin(7.0 * x) * np.cos(9.0 * z)
    flux = model.engine.water_flux(rates)
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


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    decades=st.floats(0.0, 4.0),
    commanded=st.lists(st.floats(-900.0, 900.0), min_size=5, max_size=5),
    step=st.floats(0.1, 900.0),
    preset=st.sampled_from(sorted(PRESETS)),
    effect=st.sampled_from([None, 'dispersion', 'buoyancy', 'viscosity', 'dual_porosity']),
    sides=st.sampled_from(sorted(SIDES)),
)
def test_predictions_stay_within_the_range_of_initial_and_injected_values(
    make_rig, seed, decades, commanded, step, preset, effect, sides
) -> None:
    rng = np.random.default_rng(seed)
    rig = make_rig(boundaries=SIDES[sides])
    names = list(rig.wells)
    if sides == 'closed':
        commanded[-1] = -math.fsum(commanded[:-1])
    rates = {
        name: WellRate(from_ml_h(rate), float(rng.random()))
        for name, rate in zip(names, commanded, strict=True)
    }
    rig = with_permeability(rig, 6.57e-10 * 10 ** rng.uniform(-decades, 0.0, (13, 17)))
    grid = rig.grid(17, 13)
    model = Model(rig, grid, preset=preset, effects=[described(effect)] if effect else [])
    found = model.predict(rough_map(grid.shape, seed), rates, step)
    assert found.min() >= -1e-13
    assert found.max() <= 1.0 + 1e-13


def test_one_long_step_is_stable_and_close_to_short_ones(rig, rates) -> None:
    """One photograph interval of 300 s compared with ten of 30 s."""
    model = Model(rig, rig.grid(93, 56), preset='fast')
    start = model.predict(model.initial_condition(), rates, 600.0)
    small = start
    for _ in range(10):
        small = model.predict(small, rates, 30.0)
    large = model.predict(start, rates, 300.0)
    assert np.linalg.norm(large - small) < 0.02 * np.linalg.norm(small)


def refusals(rig: Rig) -> dict[str, tuple]:
    """Return calls that must be refused, by the pattern of their message."""
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

    def zone(x: float, factor: float) -> EffectDescription:
        parameters = {'x': x, 'z': 0.3, 'radius': 0.1, 'permeability_factor': factor}
        return EffectDescription(name='heterogeneity', parameters=parameters)

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
        r'permeability: it differs by a factor of 1e.15 within the rig': lambda: Model(
            rig, grid, effects=[zone(0.3, 1e9), zone(0.7, 1e-6)]
        ),
        r"effect 'magic': unknown; choose from background_flow": effect('magic'),
        r"effect decay: unknown parameter 'speed'; known: rate": effect('decay', speed=1.0),
        r"effect decay: parameter 'rate' \[1/s\] is missing": effect('decay'),
        r'effect decay: rate = -1: must be at least 0': effect('decay', rate=-1.0),
        r'effect viscosity: viscosity_ratio = 0: must be at least 0.001': effect(
            'viscosity', viscosity_ratio=0.0
        ),
        r"effect porosity: factor = 'much': give a number": effect('porosity', factor='much'),
        r'porosity 1.125: must not exceed 1': effect('porosity', factor=3.0),
        r'effect porosity: factor = -0.5: must be at least 0.01': effect('porosity', factor=-0.5),
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


@pytest.mark.parametrize('number', range(25))
def test_bad_input_is_refused_with_thing_value_and_remedy_in_one_line(rig, number) -> None:
    listed = [(text, call) for text, call in refusals(rig).items() if call is not None]
    text, call = listed[number]
    with pytest.raises(InputError, match=text) as refusal:
        call()
    assert '\n' not in str(refusal.value)


def test_every_refusal_is_tested(rig) -> None:
    assert len([call for call in refusals(rig).values() if call is not None]) == 25


def test_balanced_rates_are_accepted_in_a_closed_rig(make_rig, rates) -> None:
    rig = make_rig(boundaries=SIDES['closed'])
    assert net_rate(rates) == pytest.approx(0.0, abs=1e-20)
    model = Model(rig, rig.grid(17, 11), preset='fast')
    assert model.predict(model.initial_condition(), rates, 30.0).max() > 0.0


def test_no_pressure_is_solved_after_the_preparation_of_a_large_grid(
    rig, rates, monkeypatch
) -> None:
    monkeypatch.setattr('porotwin_solver.model.engine.THREADED_CELLS', 100)
    model = Model(rig, rig.grid(33, 19), preset='fast')
    model.prepare()
    solved = []
    monkeypatch.setattr(model.engine.flow._pressures, 'solve_once', solved.append)
    model.predict(rough_map((19, 33), 4), rates, 30.0)
    assert not solved
