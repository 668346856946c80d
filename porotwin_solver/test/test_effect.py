"""The definition of an effect: complete, and consistent with its search, words and draws."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.model.blind_draw import DrawContext
from porotwin_core.model.effect_parameter import Parameter
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import SearchContext
from porotwin_solver.effects.definition.effect import Effect, Scope

WORKING = {
    'name': 'brine',
    'scope': Scope.RIG,
    'parameters': {'salt': Parameter(unit='kg/m3')},
    'on_physics': lambda physics, _values: physics,
    'candidates': lambda _context: (),
    'phrase': lambda _values: 'the water is salt',
    'laboratory_check': 'taste it',
}
"""A complete definition."""

KNOWN = (
    *('numerical_diffusion', 'dispersion', 'buoyancy', 'viscosity', 'retardation', 'decay'),
    *('dual_porosity', 'heterogeneity', 'porosity', 'depth', 'rate', 'well_position', 'leak'),
    *('background_flow', 'saturation', 'illumination', 'registration', 'clock'),
)
"""Effects whose conventions the diagnosis relies on."""

NEVER_DRAWN = {'wave', 'fringe', 'permeability', 'water_body', 'water_level'}
"""Effects without consequence for the rigs of the blind check: these are open at the top only."""

OVER_TIME = {'stock_strength', 'dead_volume'}
"""Effects that the check of causes over time draws."""


@pytest.fixture
def context(rig) -> SearchContext:
    """An hour on the small rig, with two pumping wells."""
    grid = rig.grid(187, 112)
    return SearchContext(
        rig, grid, 3600.0, ('injector', 'producer'), 1.4e-7, 'injector', ('injector',)
    )


def test_a_bottle_is_weak_from_the_start_beside_another_one(context) -> None:
    bottle = EFFECTS['stock_strength']
    assert bottle.candidates(context) == []  # it looks like a pale camera
    beside = replace(context, tracer_wells=('injector', 'producer'))
    assert bottle.candidates(beside) == bottle.begins(context)


def test_a_complete_definition_is_taken() -> None:
    brine = Effect(**WORKING)
    assert brine.checked({'salt': '2'}) == {'salt': 2.0}
    assert not brine.is_of_camera and not brine.has_place


@pytest.mark.parametrize(
    ('changes', 'fault'),
    [
        ({'on_physics': None}, 'on_physics, on_observation: give one of the two'),
        ({'on_observation': lambda operator, _: operator}, 'give one of the two'),
        ({'scope': Scope.CAMERA}, 'on_observation exactly if it is of the camera'),
        ({'laboratory_check': ''}, 'laboratory_check: say how to check it'),
        ({'scope': Scope.PLACE}, 'places: needed for an effect with a place'),
        ({'scope': Scope.WELL}, "an effect of a well needs 'well'"),
        ({'parameters': {}}, 'parameters: give at least one'),
    ],
)
def test_an_incomplete_definition_is_refused_in_one_line(changes, fault) -> None:
    with pytest.raises(InputError, match="effect 'brine' is incomplete: ") as refusal:
        Effect(**{**WORKING, **changes})
    assert fault in str(refusal.value)
    assert '\n' not in str(refusal.value)


def test_an_effect_without_candidates_is_refused() -> None:
    without = {key: value for key, value in WORKING.items() if key != 'candidates'}
    with pytest.raises(InputError, match='candidates: without them no diagnosis finds it'):
        Effect(**without)


@pytest.mark.parametrize('name', EFFECTS)
def test_candidates_fit_or_fix_every_parameter_in_its_unit_and_range(name, context) -> None:
    effect = EFFECTS[name]
    for candidate in (*effect.candidates(context), *effect.begins(context)):
        assert candidate.effect == name
        fitted = {parameter.name: parameter for parameter in candidate.parameters}
        given = fitted.keys() | candidate.fixed.keys()
        missing = effect.parameters.keys() - given
        assert given <= effect.parameters.keys()
        assert all(effect.parameters[key].default is not None for key in missing)
        for key, parameter in fitted.items():
            assert parameter.unit == effect.parameters[key].unit
        for key in candidate.fixed.keys() - {'well'}:
            assert effect.parameters[key].may_be_fixed
        for start in candidate.starts or (candidate.first,):
            effect.checked(candidate.described(start).parameters)


@pytest.mark.parametrize('name', EFFECTS)
def test_every_number_of_an_effect_has_limits(name) -> None:
    for key, parameter in EFFECTS[name].parameters.items():
        if parameter.is_name:
            continue
        assert math.isfinite(parameter.low) and math.isfinite(parameter.high), key
        for value in (parameter.neutral, parameter.default or parameter.neutral):
            assert value == 0.0 or parameter.low <= value <= parameter.high, key


def contexts(rig) -> Iterator[SearchContext]:
    """Yield recordings of tiny and huge rigs, over seconds and weeks."""
    for size, duration in itertools.product((0.02, 20.0), (10.0, 2e6)):
        width, height = size, 0.6 * size
        wells = {'injector': replaced(rig.wells['injector'], x_m=0.3 * width, z_m=0.4 * height)}
        other = replaced(rig, width_m=width, height_m=height, wells=wells, porosity=0.02)
        grid = other.grid(40, 24)
        yield SearchContext(other, grid, duration, ('injector',), 1e-6, 'injector', ('injector',))


def replaced(described, **values):
    """Return a copy of a part of a rig with other values."""
    return described.model_copy(update=values)


@pytest.mark.parametrize('name', EFFECTS)
def test_no_search_leaves_the_limits_of_a_parameter(name, rig) -> None:
    effect = EFFECTS[name]
    for context in contexts(rig):
        candidates = [*effect.candidates(context), *effect.begins(context)]
        if effect.places is not None:
            candidates += effect.places.trials(context, context.middle)
        for candidate in candidates:
            for fitted in candidate.parameters:
                limits = effect.parameters[fitted.name]
                assert limits.low <= fitted.low <= fitted.high <= limits.high, fitted.name


@pytest.mark.parametrize('name', EFFECTS)
def test_every_effect_states_its_parameters_in_one_phrase(name, context) -> None:
    effect = EFFECTS[name]
    for candidate in (*effect.candidates(context), *effect.begins(context)):
        said = effect.phrase(candidate.described(candidate.first).parameters)
        assert len(said) > 20
        assert not said.endswith('.')


@pytest.mark.parametrize('name', EFFECTS)
def test_drawn_parameters_are_complete_and_in_range(name, rig) -> None:
    effect = EFFECTS[name]
    if effect.blind_draw is None:
        assert effect.scope is Scope.MODEL or name in NEVER_DRAWN | OVER_TIME
        return
    context = DrawContext(rig, ('injector', 'control1'), 3600.0, 450.0)
    for seed in range(20):
        drawn = effect.blind_draw(np.random.default_rng(seed), context)
        effect.checked(drawn)


def test_equality_of_effects_is_mutual_where_it_holds() -> None:
    denser = {'factor': 0.9}
    assert EFFECTS['porosity'].equal_to(denser) == ()
    assert EFFECTS['porosity'].equal_to({'factor': 1.1}) == ('retardation',)
    assert EFFECTS['retardation'].equal_to({'retardation_factor': 1.1}) == ('porosity',)


def test_conventions_of_the_effects() -> None:
    """The general rules of the diagnosis are about these effects."""

    def those(has) -> set[str]:
        return {name for name in KNOWN if has(EFFECTS[name])}

    cheap = {'saturation', 'illumination', 'registration'}
    assert those(lambda e: not e.needs_simulation) == cheap
    assert those(lambda e: e.is_of_camera) == {*cheap, 'clock'}
    assert those(lambda e: e.replaces_nominal) == {
        'dispersion',
        'buoyancy',
        'viscosity',
        'dual_porosity',
    }
    assert those(lambda e: e.has_place) == {'heterogeneity', 'leak'}
    assert those(lambda e: e.is_slow_on_fine_grids) == {'dispersion'}
    assert those(lambda e: e.misfit_allowance == 1.5) == {'viscosity'}
    assert those(lambda e: e.misfit_allowance == 1.0) == set(KNOWN) - {'viscosity'}
