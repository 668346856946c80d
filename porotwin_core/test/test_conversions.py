"""Tests of the conversions: values survive, wrong messages are refused."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rcl_interfaces.msg import Parameter, ParameterValue
from rclpy.serialization import deserialize_message, serialize_message

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.delivered_rates import USUAL_PUMP, PumpFactor
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import EffectDescription, parse_rig, rig_from_maps
from porotwin_core.ros import conversions
from porotwin_msgs.msg import NewState, Outcome, Pause
from porotwin_msgs.msg import WellRate as WellRateMessage

GRID = Grid(7, 4, 0.934, 0.562)
PLAIN: dict[str, Any] = {
    'name': 'small',
    'width_m': 0.9,
    'height_m': 0.5,
    'depth_m': 0.01,
    'porosity': 0.4,
    'permeability_m2': 1e-9,
    'viscosity_pa_s': 1e-3,
    'density_kg_m3': 998.0,
    'wells': {'a': {'x_m': 0.2, 'z_m': 0.2}},
}
CONTROL: dict[str, Any] = {'wells': ['a'], 'disallowed_zone_m': [[0, 0.4], [0.9, 0.4], [0.9, 0.5]]}


def over_the_wire(message: Any) -> Any:
    """Return `message` as another process gets it."""
    return deserialize_message(serialize_message(message), type(message))


@given(seconds=st.floats(0, 4e9))
def test_stamps_keep_microseconds_over_centuries(seconds: float) -> None:
    assert conversions.time_from_msg(conversions.time_to_msg(seconds)) == pytest.approx(
        seconds, abs=1e-6
    )


@given(seconds=st.floats(-2e9, 2e9))
def test_a_span_keeps_nanoseconds(seconds: float) -> None:
    again = conversions.seconds_from_msg(over_the_wire(conversions.duration_to_msg(seconds)))
    assert again == pytest.approx(seconds, abs=1e-6)


@pytest.mark.parametrize('seconds', [math.nan, math.inf, 1e12])
def test_a_span_that_no_message_holds_is_refused(seconds: float) -> None:
    with pytest.raises(InputError, match='fits no message'):
        conversions.duration_to_msg(seconds)


def test_a_bag_of_version_0_2_has_seconds_and_an_objective_as_texts() -> None:
    assert conversions.seconds_from_msg(30.0) == 30.0
    rig = parse_rig(
        {**PLAIN, 'control': {**CONTROL, 'objective': {'name': 'keep_in', 'fuzziness_m': 0.2}}},
        Path('rig.yaml'),
    )
    limits = (message := conversions.rig_to_msg(rig)).control[0]
    old = {name: getattr(limits, name) for name in limits.get_fields_and_field_types()}
    for name in ('pauses', 'max_producer_rate', 'stock'):
        del old[name]
    fields = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    texts = SimpleNamespace(**{**old, 'objective_parameters': '{"fuzziness_m": 0.2}', 'end': 0.0})
    assert conversions.rig_from_msg(SimpleNamespace(**{**fields, 'control': [texts]})) == rig
    texts.objective_parameters = '[1, 2'
    with pytest.raises(InputError, match=r"rig description: objective_parameters '\[1, 2'"):
        conversions.rig_from_msg(SimpleNamespace(**{**fields, 'control': [texts]}))


def test_a_map_survives_the_wire() -> None:
    values = np.random.default_rng(2).random(GRID.shape).astype(np.float32)
    values[1, 2] = np.nan
    message = conversions.tracer_to_msg(values, GRID, 12.5)
    received = deserialize_message(serialize_message(message), type(message))
    field, grid = conversions.tracer_from_msg(received)
    np.testing.assert_array_equal(field, values)
    assert grid == GRID
    assert conversions.time_from_msg(received.header.stamp) == 12.5


def test_deviations_survive_the_wire_and_may_be_missing() -> None:
    values = np.random.default_rng(2).random(GRID.shape).astype(np.float32)
    values[1, 2] = np.nan
    message = NewState(deviation=conversions.map_to_msg(values))
    received = deserialize_message(serialize_message(message), NewState)
    np.testing.assert_array_equal(conversions.deviation_from_msg(received.deviation, GRID), values)
    assert conversions.deviation_from_msg(received.systematic, GRID) is None


@pytest.mark.parametrize('wrong', [-0.1, np.inf])
def test_a_deviation_that_is_none_is_refused(wrong: float) -> None:
    values = np.full(GRID.shape, 0.1)
    values[0, 0] = wrong
    with pytest.raises(InputError, match='a standard deviation is 0 or more'):
        conversions.deviation_from_msg(conversions.map_to_msg(values), GRID)
    with pytest.raises(InputError, match='has 3 values on a grid of 7 x 4'):
        conversions.deviation_from_msg(conversions.map_to_msg(np.ones(3)), GRID)


def test_a_source_survives_the_wire_in_double_precision() -> None:
    values = np.random.default_rng(2).standard_normal(GRID.shape)
    message = conversions.source_to_msg(values, GRID, 0.0)
    received = deserialize_message(serialize_message(message), type(message))
    np.testing.assert_array_equal(conversions.source_from_msg(received)[0], values)


def test_a_plan_and_a_cost_term_survive_the_wire() -> None:
    later = {'a': WellRate(2e-8, 1.0), 'left': WellRate(rise=0.01)}
    plan = (RateStep(0.0, {'a': WellRate(1e-8)}), RateStep(60.0, later))
    assert conversions.plan_from_msg(conversions.plan_to_msg(plan)) == plan
    weights = np.random.default_rng(2).random(GRID.shape)
    message = conversions.cost_term_to_msg(CostTerm(5.0, 9.0, quadratic=weights))
    received = deserialize_message(serialize_message(message), type(message))
    term = conversions.cost_term_from_msg(received, GRID)
    assert (term.start, term.end, term.linear, term.target) == (5.0, 9.0, None, None)
    np.testing.assert_array_equal(term.quadratic, weights)
    with pytest.raises(InputError, match='cost term, quadratic: has 28 values on a grid of 2 x 2'):
        conversions.cost_term_from_msg(received, Grid(2, 2, 0.9, 0.5))


def test_a_map_that_does_not_fit_its_grid_is_refused() -> None:
    message = conversions.tracer_to_msg(np.zeros(GRID.shape), GRID, 0.0)
    message.grid.nx = 8
    with pytest.raises(InputError, match='28 values on a grid of 8 x 4'):
        conversions.tracer_from_msg(message)


def test_rates_survive_and_wrong_ones_are_refused() -> None:
    rates = {'injector': WellRate(1.4e-7, 1.0), 'producer': WellRate(-1.4e-7)}
    messages = conversions.rates_to_msg(rates)
    assert conversions.rates_from_msg(messages) == rates
    with pytest.raises(InputError, match="'injector' is named twice"):
        conversions.rates_from_msg([messages[0], messages[0]])
    with pytest.raises(InputError, match="'a': well rate nan"):
        conversions.rates_from_msg([WellRateMessage(well='a', rate=float('nan'))])


def test_beliefs_about_pumps_survive_and_impossible_ones_are_refused() -> None:
    pumps = {'injector': PumpFactor(0.85, 0.02, 0.9), 'producer': USUAL_PUMP}
    messages = conversions.pumps_to_msg(pumps)
    assert conversions.pumps_from_msg(messages) == pumps
    for wrong in (0.0, math.nan, math.inf):
        messages[0].deviation = wrong
        with pytest.raises(InputError, match="pump of well 'injector'"):
            conversions.pumps_from_msg(messages)
    messages[0].deviation = 0.02
    for wrong in (1e-308, 1e308):
        messages[0].metered = wrong
        with pytest.raises(InputError, match='factors from 1e-06 to 1e\\+06'):
            conversions.pumps_from_msg(messages)


def test_a_refusal_is_one_line() -> None:
    outcome = conversions.refusal(InputError('two\nlines'))
    assert (outcome.code, outcome.message) == (Outcome.INVALID_INPUT, 'two lines')
    assert conversions.refusal(RuntimeError()).code == Outcome.FAILED


@pytest.mark.parametrize('with_maps', [False, True])
def test_a_rig_survives_the_wire(with_maps: bool) -> None:
    data: dict[str, Any] = {
        'name': 'small',
        'width_m': 0.934,
        'height_m': 0.562,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'boundaries': {
            'top': 'closed',
            'left': 'open',
            'right': 'open',
            'heads_m': {'left': 0.5, 'right': 0.48},
        },
        'levels': {'left': {'points': [[5, 0.51], [5, '49 cm']], 'every_min': 7.5}},
        'wells': {
            'a': {'x_m': 0.2, 'z_m': 0.2},
            'b': {'x_m': 0.6, 'z_m': 0.1, 'radius_m': 0.01},
            'c': {'x_m': 0.4, 'z_m': 0.3, 'rate_prior_ml_h': [50, 200]},
        },
        'camera': {
            'corners_px': [[11, 8], [16, 1755], [3165, 1748], [3165, 5]],
            'curvature': {'vertical_bulge': -2.73e-8},
        },
        'control': {
            'wells': ['a'],
            'producer': 'b',
            'rate_step_ml_h': 5.0,
            'min_rate_ml_h': 20.0,
            'max_change_ml_h': 100.0,
            'change_cost_ml_min': 0.25,
            'end_min': 80.0,
            'fixed': {'c': {'rate_ml_h': 120.0, 'pauses_min': [[10, 15], [40.5, 50]]}},
            'max_producer_rate_ml_h': 900.0,
            'stock_ml': 250.0,
            'disallowed_zone_m': [[0, 0.4], [0.9, 0.4], [0.9, 0.5]],
        },
        'effects': [{'name': 'rate', 'parameters': {'well': 'a', 'factor': 0.95}}],
    }
    quantities: dict[str, Any] = {'depth_m': 0.01, 'porosity': 0.375, 'permeability_m2': 6.57e-10}
    if with_maps:
        quantities['depth_m'] = np.linspace(0.01, 0.02, 20).reshape(4, 5)
    rig = rig_from_maps(data, quantities)
    message = conversions.rig_to_msg(rig)
    again = conversions.rig_from_msg(deserialize_message(serialize_message(message), type(message)))
    assert again == rig
    assert again.physics_fingerprint == rig.physics_fingerprint
    np.testing.assert_array_equal(again.nominal_map('depth_m'), rig.nominal_map('depth_m'))
    if not with_maps:
        assert again == parse_rig({**data, **quantities}, Path('rig.yaml'))


@pytest.mark.parametrize(
    'objective',
    [
        'keep_out',
        {'name': 'keep_in', 'zone_m': [[0, 0.1], [1, 2], [3, 0]]},
        {
            'name': 'sum',
            'parts': [
                {'name': 'keep_in', 'zone_m': [[0, 0.1], [1, 2], [3, 0]], 'weight': 2},
                {'name': 'of_a_lab', 'wells': ['a'], 'whole': True, 'steps': []},
            ],
        },
    ],
)
def test_an_objective_survives_the_wire(objective: Any) -> None:
    rig = parse_rig({**PLAIN, 'control': {**CONTROL, 'objective': objective}}, Path('rig.yaml'))
    message = conversions.rig_to_msg(rig)
    again = conversions.rig_from_msg(deserialize_message(serialize_message(message), type(message)))
    assert again == rig


def test_a_message_without_the_fields_of_the_objective_means_keep_out() -> None:
    rig = parse_rig({**PLAIN, 'control': CONTROL}, Path('rig.yaml'))
    message = conversions.rig_to_msg(rig)
    limits = message.control[0]
    names = [name for name in limits.get_fields_and_field_types() if 'objective' not in name]
    old = SimpleNamespace(**{name: getattr(limits, name) for name in names})
    fields = message.get_fields_and_field_types()
    record = SimpleNamespace(**{name: getattr(message, name) for name in fields})
    record.control = [old]
    assert conversions.rig_from_msg(record) == rig


def spoil_radius(message: Any) -> None:
    message.wells[0].radius = -1.0


def spoil_corners(message: Any) -> None:
    message.camera[0].corners = [float('nan')] * 8


def spoil_curvature(message: Any) -> None:
    message.camera[0].curvature_values = [1.0, 2.0]


def spoil_zone(message: Any) -> None:
    message.control[0].disallowed_zone = [0.1] * 7


def spoil_limit(message: Any) -> None:
    message.control[0].max_rate = 0.0


def spoil_objective(message: Any) -> None:
    message.control[0].objective_parameters = [Parameter(name='zone_m')]


def spoil_nesting(message: Any) -> None:
    text = ParameterValue(type=4, string_value='keep_in')
    message.control[0].objective_parameters = [
        Parameter(name=name, value=text) for name in ('parts', 'parts.0')
    ]


def spoil_pause(message: Any) -> None:
    message.control[0].pauses = [Pause(well='a')]


def spoil_effect(message: Any) -> None:
    message.effects[0].parameter_texts = []


@pytest.mark.parametrize(
    ('spoil', 'complaint'),
    [
        (spoil_radius, 'wells.a.radius_m = -1.0'),
        (spoil_corners, 'camera.corners_px'),
        (spoil_curvature, 'curvature has not one value for each name'),
        (spoil_zone, 'disallowed_zone has 7 numbers; send pairs'),
        (spoil_limit, 'control.max_rate_ml_h = 0.0'),
        (spoil_objective, "objective parameter 'zone_m' has no value"),
        (spoil_nesting, "parameter 'parts.0': 'parts' has a value too"),
        (spoil_pause, "a pause of 'a', which is not fixed"),
        (spoil_effect, "effect 'rate' has not one value for each name"),
    ],
)
def test_a_wrong_rig_description_is_refused_in_one_line(spoil: Any, complaint: str) -> None:
    data = {
        **PLAIN,
        'camera': {'corners_px': [[1, 8], [1, 17], [31, 17], [31, 8]], 'curvature': {'bulge': 1.0}},
        'control': CONTROL,
        'effects': [{'name': 'rate', 'parameters': {'well': 'a', 'factor': 0.95}}],
    }
    rig = parse_rig(data, Path('rig.yaml'))
    message = conversions.rig_to_msg(rig)
    spoil(message)
    with pytest.raises(InputError) as caught:
        conversions.rig_from_msg(message)
    assert str(caught.value).startswith('rig description: ')
    assert complaint in str(caught.value)
    assert '\n' not in str(caught.value)


def test_effects_survive_the_wire_and_a_parameter_is_one_finite_number() -> None:
    effect = EffectDescription(name='rate', parameters={'well': 'a', 'factor': 0.7})
    message = conversions.effect_to_msg(effect)
    assert conversions.effects_from_msg([message]) == (effect,)
    message.parameter_values[1] = math.nan
    with pytest.raises(InputError, match="effect 'rate': factor = nan; send a finite number"):
        conversions.effects_from_msg([message])
    message = conversions.effect_to_msg(effect)
    message.parameter_names.append('factor')
    message.parameter_values.append(0.9)
    message.parameter_texts.append('')
    with pytest.raises(InputError, match="effect 'rate': factor is given twice; send it once"):
        conversions.effects_from_msg([message])


def test_learnt_physics_survives_the_wire() -> None:
    effects = (
        EffectDescription(name='buoyancy', parameters={'density_difference': 0.9}),
        EffectDescription(name='leak', parameters={'x': 0.1, 'z': 0.2, 'rate': -7.2}),
    )
    messages = conversions.learnt_to_msg(LearntPhysics(effects))
    assert conversions.effects_from_msg(map(over_the_wire, messages)) == effects


def test_numbers_without_a_point_survive_the_wire() -> None:
    plan = [RateStep(0, {'a': WellRate(1, 1)})]
    step = over_the_wire(conversions.plan_to_msg(plan)[0])
    assert conversions.plan_from_msg([step]) == (RateStep(0.0, {'a': WellRate(1.0, 1.0)}),)
    effect = EffectDescription.model_construct(name='rest', parameters={'factor': 2})
    message = over_the_wire(conversions.effect_to_msg(effect))
    assert list(message.parameter_values) == [2.0]
    assert over_the_wire(conversions.grid_to_msg(Grid(2, 2, 1, 1))).width == 1.0
