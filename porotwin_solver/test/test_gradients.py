"""Gradients compared with finite differences of whole simulations."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML_H, from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import EffectDescription
from porotwin_solver.adjoint import gradient
from porotwin_solver.model.simulation import simulate

TIMES = np.array([200.0, 430.0, 600.0])
EFFECTS = {
    'dispersion': {
        'longitudinal_dispersivity': 0.004,
        'transverse_dispersivity': 0.0006,
        'diffusion': 2e-9,
    },
    'decay': {'rate': 1e-4},
    'dual_porosity': {'immobile_fraction': 0.05, 'exchange_rate': 3e-4},
    'porosity': {'factor': 0.9},
    'retardation': {'retardation_factor': 1.1},
    'depth': {'factor_centre': 1.05},
    'heterogeneity': {'x': 0.3, 'z': 0.3, 'radius': 0.06, 'permeability_factor': 0.3},
    'rate': {'well': 'injector', 'factor': 0.95},
    'well_position': {'well': 'injector', 'dx': 0.003, 'dz': 0.006},
    'leak': {'x': 0.4, 'z': 0.3, 'rate': -30.0},
    'background_flow': {'x_velocity': 1e-6, 'z_velocity': 5e-7},
    'numerical_diffusion': {'model_diffusion': 1e-8},
    'buoyancy': {'density_difference': 0.7},
    'viscosity': {'viscosity_ratio': 1.3},
    'saturation': {'exponent': 1.3},
    'illumination': {'drift': -1e-4, 'gradient': 0.1},
    'registration': {'dx': 0.003, 'dz': -0.004, 'rotation': 0.02, 'scale': 1.02},
}


def schedule(change: tuple[str, int, float, float] = ('', 0, 0.0, 0.0)) -> Schedule:
    """Return rates that change every 150 s.

    `change` adds to one rate and its concentration: well, piece, rate [m^3/s], concentration.
    """
    rows = []
    for piece in range(4):
        commanded = {
            'injector': (450.0, 0.9),
            'control1': (60.0 + 10 * piece, 0.0),
            'control3': (120.0 - 20 * piece, 0.2),
            'producer': (-500.0, 0.0),
        }
        for well, (rate, concentration) in commanded.items():
            more = change if (well, piece) == change[:2] else ('', 0, 0.0, 0.0)
            rows.append(
                ScheduleRow(
                    150.0 * piece, well, WellRate(rate * ML_H + more[2], concentration + more[3])
                )
            )
    return Schedule(tuple(rows))


TOLERANCES = {'fast': 3e-5, 'accurate': 2e-3, 'upwind': 1e-6}
"""Relative tolerances. Where the plume is nearly flat, most of all on a fine grid, the kinks of the
limiters lie so close that every difference spans some. The dot-product tests of the kernels are the
sharp ones."""


SIZES = {'accurate': (24, 14)}
"""Columns and rows of the grid where the preset refines it, so that it computes on as many cells as
the others."""


class Problem:
    """A cost of the maps at TIMES: the sum of their squares with random weights."""

    def __init__(self, rig, preset: str, effects: dict[str, dict]) -> None:
        self.rig, self.grid, self.preset = rig, rig.grid(*SIZES.get(preset, (47, 28))), preset
        self.effects = effects
        self.weights = np.random.default_rng(1).random((len(TIMES), *self.grid.shape))

    def part(self, index: int, seen: FloatArray) -> tuple[float, FloatArray]:
        return float((self.weights[index] * seen**2).sum()), 2.0 * self.weights[index] * seen

    def descriptions(self, effects: dict[str, dict]) -> list[EffectDescription]:
        return [EffectDescription(name=name, parameters=given) for name, given in effects.items()]

    def cost(self, commanded: Schedule, effects: dict[str, dict] | None = None) -> float:
        maps = simulate(
            self.rig,
            commanded,
            TIMES,
            grid=self.grid,
            preset=self.preset,
            effects=self.descriptions(self.effects if effects is None else effects),
        )
        return sum(self.part(index, seen)[0] for index, seen in enumerate(maps))

    def gradient(self, parameters=(), *, by_concentration: bool = True):
        return gradient(
            self.rig,
            schedule(),
            TIMES,
            self.part,
            grid=self.grid,
            preset=self.preset,
            effects=self.descriptions(self.effects),
            parameters=parameters,
            by_concentration=by_concentration,
        )


def piece_sum(found, values: FloatArray, piece: int) -> float:
    """Return the derivative by a rate that holds for 150 s: the sum over its intervals."""
    return sum(
        value
        for (start, _), value in zip(found.intervals, values, strict=True)
        if 150.0 * piece <= start < 150.0 * (piece + 1)
    )


@pytest.mark.parametrize('preset', TOLERANCES)
@pytest.mark.parametrize('effects', [{}, EFFECTS], ids=['plain', 'all effects'])
def test_the_gradient_by_rates_equals_finite_differences(rig, preset, effects) -> None:
    problem = Problem(rig, preset, effects)
    found = problem.gradient()
    assert found.cost == pytest.approx(problem.cost(schedule()), rel=1e-13)
    for well, piece in (('injector', 1), ('control3', 1), ('producer', 2), ('control1', 3)):
        value = piece_sum(found, found.rate[well], piece)
        # a cell may change its limiter or its level within one difference, hardly within all three
        differences = []
        for step in (1e-7, 1e-6, 1e-5):
            by = step * from_ml_h(500.0)
            more = problem.cost(schedule((well, piece, by, 0.0)))
            less = problem.cost(schedule((well, piece, -by, 0.0)))
            differences.append((more - less) / (2.0 * by))
        closest = min(differences, key=lambda difference: abs(difference - value))
        assert value == pytest.approx(closest, rel=TOLERANCES[preset]), (
            f'{well} {piece}: {differences}'
        )
    value = piece_sum(found, found.concentration['control3'], 1)
    differences = []
    for step in (1e-8, 1e-7, 1e-6):
        more = problem.cost(schedule(('control3', 1, 0.0, step)))
        less = problem.cost(schedule(('control3', 1, 0.0, -step)))
        differences.append((more - less) / (2.0 * step))
    closest = min(differences, key=lambda difference: abs(difference - value))
    assert value == pytest.approx(closest, rel=TOLERANCES[preset]), differences


def test_the_gradient_by_every_effect_parameter_equals_finite_differences(rig) -> None:
    problem = Problem(rig, 'fast', EFFECTS)
    named = [
        (effect, name)
        for effect, given in EFFECTS.items()
        for name, value in given.items()
        if not isinstance(value, str)
    ]
    found = problem.gradient(named)
    assert len(named) == 31
    for (effect, name), value in zip(named, found.parameters, strict=True):
        step = 1e-6 * abs(EFFECTS[effect][name])
        shifted = [
            problem.cost(
                schedule(),
                {**EFFECTS, effect: {**EFFECTS[effect], name: EFFECTS[effect][name] + sign * step}},
            )
            for sign in (1.0, -1.0)
        ]
        expected = (shifted[0] - shifted[1]) / (2.0 * step)
        assert value == pytest.approx(expected, rel=1e-5, abs=1e-9), f'{effect} {name}'


@pytest.mark.parametrize(
    ('effects', 'effect', 'name', 'step'),
    [
        ({'decay': {'rate': 0.0}}, 'decay', 'rate', 1e-7),
        ({'retardation': {'retardation_factor': 1.0}}, 'retardation', 'retardation_factor', 1e-6),
        ({'rate': {'well': 'injector', 'factor': 0.0}}, 'rate', 'factor', 1e-6),
        (
            {'numerical_diffusion': {'model_diffusion': 0.0}},
            'numerical_diffusion',
            'model_diffusion',
            1e-12,
        ),
        (
            {'dual_porosity': {'immobile_fraction': 0.0, 'exchange_rate': 1e-3}},
            'dual_porosity',
            'immobile_fraction',
            1e-6,
        ),
        (
            {'dual_porosity': {'immobile_fraction': 0.1, 'exchange_rate': 0.0}},
            'dual_porosity',
            'exchange_rate',
            1e-7,
        ),
        (
            {'dual_porosity': {'immobile_fraction': 0.95, 'exchange_rate': 1e-3}},
            'dual_porosity',
            'immobile_fraction',
            -1e-7,
        ),
    ],
)
def test_the_gradient_at_the_end_of_a_range_equals_one_sided_differences(
    rig, effects, effect, name, step
) -> None:
    problem = Problem(rig, 'fast', effects)
    found = problem.gradient([(effect, name)]).parameters[0]
    costs = [
        problem.cost(
            schedule(), {effect: {**effects[effect], name: effects[effect][name] + steps * step}}
        )
        for steps in range(3)
    ]
    assert found == pytest.approx(
        (-1.5 * costs[0] + 2.0 * costs[1] - 0.5 * costs[2]) / step, rel=3e-5
    )


@pytest.mark.parametrize(
    ('diffusion', 'name', 'complaint'),
    [
        (1e-9, 'transverse_dispersivity', 'where both dispersivities are equal'),
        (0.0, 'diffusion', 'without any diffusion'),
    ],
)
def test_a_gradient_by_absent_dispersion_is_refused(rig, diffusion, name, complaint) -> None:
    neutral = {'longitudinal_dispersivity': 0.0, 'transverse_dispersivity': 0.0}
    problem = Problem(rig, 'fast', {'dispersion': {**neutral, 'diffusion': diffusion}})
    with pytest.raises(InputError, match=f'gradient by dispersion {name}: .*{complaint}'):
        problem.gradient([('dispersion', name)])


SKIPPED = {
    'plain': {},
    'diffusion': {'numerical_diffusion': {'model_diffusion': 1e-8}},
    'immobile water': {name: EFFECTS[name] for name in ('dual_porosity', 'decay')},
    'tracer-driven flow': {name: EFFECTS[name] for name in ('buoyancy', 'viscosity')},
}
"""Effects beside which empty cells may be left out of a gradient by rates."""


@pytest.mark.parametrize('preset', ['fast', 'sharp'])
@pytest.mark.parametrize('effects', SKIPPED.values(), ids=SKIPPED)
def test_empty_cells_do_not_change_the_gradient_by_rates(rig, preset, effects) -> None:
    problem = Problem(rig, preset, effects)
    whole, quick = problem.gradient(), problem.gradient(by_concentration=False)
    for well, derivatives in whole.rate.items():
        np.testing.assert_allclose(quick.rate[well], derivatives, rtol=1e-9, err_msg=well)
    for well in ('injector', 'control3'):  # they inject tracer
        np.testing.assert_allclose(
            quick.concentration[well], whole.concentration[well], rtol=1e-9, err_msg=well
        )
    assert np.abs(quick.concentration['control1'] - whole.concentration['control1']).max() > 0.0


def test_a_well_at_rest_has_the_gradient_of_a_starting_injection(rig) -> None:
    problem = Problem(rig, 'fast', {})
    found = problem.gradient()
    step = 1e-6 * from_ml_h(500.0)

    def with_control2(rate: float) -> Schedule:
        return Schedule((*schedule().rows, ScheduleRow(0.0, 'control2', WellRate(rate))))

    expected = (problem.cost(with_control2(step)) - problem.cost(with_control2(0.0))) / step
    assert found.rate['control2'].sum() == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize('table', [None, {'fringe_m': 0.0}], ids=['full', 'water table'])
def test_a_rig_without_wells_has_a_gradient_by_parameters(make_rig, table) -> None:
    sea = {'side': 'left', 'head_m': 0.45, 'concentration': 1.0}
    tank = make_rig(
        boundaries={'top': 'closed'},
        control=None,
        wells={},
        water={'sea': sea, 'land': {'side': 'right', 'head_m': 0.40}},
        water_table=table,
    )
    problem, still = Problem(tank, 'upwind', {'permeability': {'factor': 1.1}}), Schedule(())
    found = gradient(
        tank,
        still,
        TIMES,
        problem.part,
        grid=problem.grid,
        preset='upwind',
        effects=problem.descriptions(problem.effects),
        parameters=[('permeability', 'factor')],
    )
    costs = [
        problem.cost(still, {'permeability': {'factor': factor}}) for factor in (1.0999, 1.1001)
    ]
    assert not found.rate
    assert found.parameters[0] == pytest.approx((costs[1] - costs[0]) / 0.0002, rel=1e-4)


def test_the_gradient_by_the_clock_is_refused(rig) -> None:
    problem = Problem(rig, 'fast', {'clock': {'offset': 3.0}})
    with pytest.raises(InputError, match='gradient by clock offset: not available'):
        problem.gradient([('clock', 'offset')])


@pytest.mark.parametrize(
    ('effect', 'parameter', 'complaint'),
    [
        ({'rate': {'well': 'injector', 'factor': 0.9, 'since': 60.0}}, 'factor', "leave 'since'"),
        ({'rate': {'well': 'injector', 'factor': 0.9, 'since': 0.0}}, 'since', "leave 'since'"),
        ({'dead_volume': {'well': 'injector', 'volume': 5.0}}, 'volume', 'delays the tracer'),
    ],
)
def test_a_gradient_of_what_changes_over_time_is_refused(rig, effect, parameter, complaint) -> None:
    (name,) = effect
    with pytest.raises(InputError, match=complaint):
        Problem(rig, 'fast', effect).gradient([(name, parameter)])


def test_a_gradient_by_an_absent_parameter_is_refused(rig) -> None:
    with pytest.raises(InputError, match="gradient by decay 'rate': not a number among"):
        Problem(rig, 'fast', {}).gradient([('decay', 'rate')])
