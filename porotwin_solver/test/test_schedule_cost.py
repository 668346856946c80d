"""Tests of the cost of a schedule: its value, and its gradient against finite differences."""

from typing import Any

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.schedule_cost import ScheduleCost, schedule_cost
from porotwin_solver.model.model import Model
from porotwin_solver.model.rollout import rollout
from porotwin_solver.model.supervision import Supervision

HORIZON = 700.0
STARTS = (0.0, 150.0, 430.0)
RATES_ML_H = np.array([[450.0, 60.0, 120.0], [450.0, 160.0, 20.0], [300.0, 0.0, 240.0]])
WELLS = ('injector', 'control1', 'control3')


def plan(rates_ml_h: FloatArray) -> list[RateStep]:
    steps = []
    for start, values in zip(STARTS, rates_ml_h, strict=True):
        rates = {
            name: WellRate(from_ml_h(value), 1.0 if name == 'injector' else 0.0)
            for name, value in zip(WELLS, values, strict=True)
        }
        rates['producer'] = WellRate(from_ml_h(-480.0))
        steps.append(RateStep(start, rates))
    return steps


class Problem:
    """A plume at the injector, and a cost with running and final, linear and quadratic terms."""

    def __init__(self, rig: Rig, preset: str, effects: dict[str, dict[str, Any]]) -> None:
        self.grid = rig.grid(31, 19)
        given = [EffectDescription(name=n, parameters=p) for n, p in effects.items()]
        self.model = Model(rig, self.grid, preset=preset, effects=given)
        x, z = np.meshgrid(self.grid.x, self.grid.z)
        self.initial = np.exp(-((x - 0.3) ** 2 + (z - 0.25) ** 2) / 0.08**2)
        weights = np.random.default_rng(3).random((3, *self.grid.shape))
        self.terms = [
            CostTerm(0.0, HORIZON, linear=weights[0] / HORIZON),
            CostTerm(100.0, 400.0, quadratic=weights[1] / 300.0, target=weights[2]),
            CostTerm(250.0, 250.0, linear=weights[1]),
            CostTerm(HORIZON, HORIZON, quadratic=weights[2]),
        ]

    def cost(self, rates_ml_h: FloatArray) -> float:
        return schedule_cost(
            self.model,
            self.initial,
            plan(rates_ml_h),
            horizon=HORIZON,
            terms=self.terms,
            with_gradient=False,
        ).cost

    def gradient(self) -> FloatArray:
        found = schedule_cost(
            self.model, self.initial, plan(RATES_ML_H), horizon=HORIZON, terms=self.terms
        )
        assert found.cost == pytest.approx(self.cost(RATES_ML_H), rel=1e-14)
        assert found.gradient is not None
        wells = list(self.model.rig.wells)
        return found.gradient[:, [wells.index(name) for name in WELLS]]


@pytest.mark.parametrize(
    ('preset', 'effects'),
    [
        ('upwind', {}),
        ('fast', {}),
        ('upwind', {'dual_porosity': {'immobile_fraction': 0.1, 'exchange_rate': 1e-3}}),
        ('upwind', {'buoyancy': {'density_difference': 2.0}, 'decay': {'rate': 1e-4}}),
        ('upwind', {'viscosity': {'viscosity_ratio': 1.3}}),
    ],
    ids=['plain', 'second order', 'immobile water', 'buoyancy', 'viscosity'],
)
def test_the_gradient_equals_finite_differences_from_any_state(rig, preset, effects) -> None:
    problem = Problem(rig, preset, effects)
    found = problem.gradient()
    for step, well in ((0, 0), (0, 1), (1, 2), (2, 2)):
        differences = []
        # a cell may change its limiter or its level within one difference, hardly within all
        for change in (1e-1, 1e-2, 1e-3):
            by = np.zeros(RATES_ML_H.shape)
            by[step, well] = change
            rise = problem.cost(RATES_ML_H + by) - problem.cost(RATES_ML_H - by)
            differences.append(rise / from_ml_h(2.0 * change))
        off = min(abs(found[step, well] / difference - 1.0) for difference in differences)
        assert off < 1e-6, (step, well, found[step, well], differences)


def test_a_well_at_rest_has_the_gradient_of_a_starting_injection(rig) -> None:
    problem = Problem(rig, 'upwind', {})
    by = np.zeros(RATES_ML_H.shape)
    by[2, 1] = 1e-3
    base = problem.cost(RATES_ML_H)
    rise = (problem.cost(RATES_ML_H + by) - base) / from_ml_h(1e-3)
    assert problem.gradient()[2, 1] == pytest.approx(rise, rel=1e-4)


def test_the_cost_is_the_trapezoidal_integral_over_the_rollout(rig) -> None:
    problem = Problem(rig, 'fast', {})
    weights = problem.terms[0].linear
    times = np.arange(50.0, HORIZON + 1.0, 50.0)
    maps = list(rollout(problem.model, problem.initial, plan(RATES_ML_H), times))
    values = [float(np.vdot(weights, values)) for values in [problem.initial, *maps]]
    integral = 50.0 * (sum(values) - 0.5 * (values[0] + values[-1]))
    cost = schedule_cost(
        problem.model,
        problem.initial,
        plan(RATES_ML_H),
        horizon=HORIZON,
        terms=[CostTerm(0.0, HORIZON, linear=weights)],
        with_gradient=False,
    ).cost
    assert cost == pytest.approx(integral, rel=1e-3)
    last = CostTerm(HORIZON, HORIZON, linear=weights)
    at_end = schedule_cost(
        problem.model, problem.initial, plan(RATES_ML_H), horizon=HORIZON, terms=[last]
    )
    assert at_end.cost == pytest.approx(values[-1], rel=1e-3)


@pytest.mark.parametrize(
    ('change', 'complaint'),
    [
        ({'horizon': 0.0}, 'horizon 0.0 s: must be positive'),
        ({'plan': []}, 'its first step must begin at 0 s'),
        ({'plan': [RateStep(5.0, {})]}, 'its first step must begin at 0 s'),
        ({'plan': [RateStep(0.0, {}), RateStep(0.0, {})]}, 'a step at 0 s follows one at 0 s'),
        ({'plan': [RateStep(0.0, {'ghost': WellRate(1e-9)})]}, "unknown well 'ghost'"),
        ({'terms': [CostTerm(0.0, 900.0)]}, r'from 0 s to 900 s: must lie within 0 to 700 s'),
        ({'terms': [CostTerm(0.0, 1.0, linear=np.ones((2, 2)))]}, r'a map of \(2, 2\) cells'),
        ({'terms': [CostTerm(0.0, 1.0, target=np.full((19, 31), np.nan))]}, 'target: not finite'),
    ],
)
def test_a_wrong_request_is_refused(rig, change, complaint) -> None:
    problem = Problem(rig, 'upwind', {})
    arguments = {'plan': plan(RATES_ML_H), 'horizon': HORIZON, 'terms': problem.terms, **change}
    steps = arguments.pop('plan')
    with pytest.raises(InputError, match=complaint):
        schedule_cost(problem.model, problem.initial, steps, **arguments)


def test_a_gradient_that_costs_too_much_is_refused(rig) -> None:
    grid = rig.grid(31, 19)
    model = Model(rig, grid, preset='upwind', supervision=Supervision(most_cell_updates=1e4))
    with pytest.raises(InputError, match='cell updates'):
        schedule_cost(model, model.initial_condition(), plan(RATES_ML_H), horizon=HORIZON, terms=[])


@pytest.mark.parametrize('with_gradient', [False, True])
def test_a_costly_late_step_is_refused_before_the_first_one(rig, with_gradient: bool) -> None:
    bounds = Supervision(most_cell_updates=1e6)
    model = Model(rig, rig.grid(31, 19), preset='upwind', supervision=bounds)
    late = {'injector': WellRate(from_ml_h(1e8), 1.0), 'producer': WellRate(from_ml_h(-1e8))}
    with pytest.raises(InputError, match=r'over 700 s: .* cell updates'):
        schedule_cost(
            model,
            model.initial_condition(),
            [RateStep(0.0, {}), RateStep(300.0, late)],
            horizon=HORIZON,
            terms=[],
            with_gradient=with_gradient,
        )


def test_a_gradient_can_be_cancelled_on_its_way_back(rig) -> None:
    calls = 0

    def check() -> None:
        nonlocal calls
        calls += 1
        if calls == 20:
            raise RuntimeError('cancelled')

    model = Model(rig, rig.grid(31, 19), preset='upwind', supervision=Supervision(check=check))
    with pytest.raises(RuntimeError, match='cancelled'):
        schedule_cost(model, model.initial_condition(), plan(RATES_ML_H), horizon=HORIZON, terms=[])


def long_cost(
    model: Model, control_ml_h: float, hours: float, *, with_gradient: bool
) -> ScheduleCost:
    """Return the cost of tracer in the upper part over a long injection, and its gradient."""
    grid, horizon = model.grid, 3600.0 * hours
    injected, control = from_ml_h(500.0), from_ml_h(control_ml_h)
    rates = {
        'injector': WellRate(injected, 1.0),
        'control1': WellRate(control),
        'producer': WellRate(-injected - control),
    }
    above = np.broadcast_to((grid.z > 0.22)[:, None], grid.shape)
    return schedule_cost(
        model,
        np.zeros(grid.shape),
        [RateStep(0.0, rates)],
        horizon=horizon,
        terms=[CostTerm(0.0, horizon, linear=1e-6 * above)],
        with_gradient=with_gradient,
    )


def test_the_gradient_over_hours_agrees_with_finite_differences(rig) -> None:
    """Without the bounds of the derivatives it is 1e16 times too large."""
    model = Model(rig, rig.grid(40, 24), preset='fast')
    found = long_cost(model, 100.0, 6.0, with_gradient=True).gradient
    more, less = (
        long_cost(model, control, 6.0, with_gradient=False).cost for control in (102.0, 98.0)
    )
    assert found is not None
    wells = list(rig.wells)
    by_control = found[0, wells.index('control1')] - found[0, wells.index('producer')]
    assert by_control == pytest.approx((more - less) / from_ml_h(4.0), rel=0.03)


def test_a_cost_that_is_not_finite_is_refused(rig) -> None:
    problem = Problem(rig, 'upwind', {})
    endless = [CostTerm(0.0, HORIZON, linear=np.full(problem.grid.shape, 1e308))]
    with pytest.raises(InputError, match='not finite'), np.errstate(all='ignore'):
        schedule_cost(
            problem.model, problem.initial, plan(RATES_ML_H), horizon=HORIZON, terms=endless
        )


@pytest.mark.parametrize('preset', ['upwind', 'fast', 'accurate'])
@pytest.mark.parametrize('well', ['injector', 'control2'])
def test_a_rig_at_rest_has_the_gradient_of_a_starting_well(rig, preset, well) -> None:
    problem = Problem(rig, preset, {'rate': {'well': 'injector', 'factor': 0.8}})

    def cost(rate: float, *, with_gradient: bool = False) -> ScheduleCost:
        return schedule_cost(
            problem.model,
            problem.initial,
            [RateStep(0.0, {well: WellRate(rate, 0.4)})],
            horizon=HORIZON,
            terms=problem.terms,
            with_gradient=with_gradient,
        )

    rate = 1e-6 * from_ml_h(500.0)
    expected = (cost(rate).cost - cost(0.0).cost) / rate
    gradient = cost(0.0, with_gradient=True).gradient
    assert gradient is not None
    found = gradient[0, list(problem.model.engine.physics.wells).index(well)]
    assert found == pytest.approx(expected, rel=1e-3)
