"""A water level beyond an open side that differs from the described one."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY, from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, EffectDescription, Rig
from porotwin_solver.adjoint import gradient
from porotwin_solver.coefficients.physics import Physics, nominal_physics
from porotwin_solver.effects import EFFECTS, parse_effect
from porotwin_solver.effects.definition.candidate import SearchContext
from porotwin_solver.flow.background_flux import background_flux
from porotwin_solver.model.simulation import simulate

RESERVOIRS = {'top': 'closed', 'left': 'open', 'right': 'open'}
"""Open to a reservoir on the left and on the right."""


def physics_of(rig: Rig, effect: str = '') -> Physics:
    """Return the coefficients of `rig`, with one effect if there is a text."""
    physics = nominal_physics(rig, rig.grid(31, 17))
    if not effect:
        return physics
    described = parse_effect(effect)
    known = EFFECTS[described.name]
    return known.on_physics(physics, known.checked(described.parameters))


@pytest.mark.parametrize(
    'heads', [None, {'left': 0.62, 'right': 0.60}, {'left': 0.6, 'right': 0.7}]
)
def test_a_rise_acts_as_the_same_heads_in_rig_yaml(make_rig, heads) -> None:
    rig = make_rig(boundaries={**RESERVOIRS, 'heads_m': heads})
    wrong = {'left': 0.005, 'right': 0.0}
    higher = {side: (heads or {}).get(side, 0.0) + rise for side, rise in wrong.items()}
    expected = physics_of(make_rig(boundaries={**RESERVOIRS, 'heads_m': higher}))
    found = physics_of(rig, 'water_level:left=0.005')
    for one, other in zip(found.water_potentials[0], expected.water_potentials[0], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)
    np.testing.assert_allclose(background_flux(found).x, background_flux(expected).x, rtol=1e-9)


def test_two_effects_add_up(make_rig) -> None:
    rig = make_rig(boundaries=RESERVOIRS)
    known = EFFECTS['water_level']
    physics = physics_of(rig, 'water_level:left=0.005')
    both = known.on_physics(physics, known.checked({'right': -0.002}))
    outer, _ = both.water_potentials
    np.testing.assert_allclose(outer.left, 998.0 * GRAVITY * 0.007)


@pytest.mark.parametrize(
    ('boundaries', 'effect', 'complaint'),
    [
        (RESERVOIRS, 'top=0.01', 'beyond the top side, which is closed; open sides: left, right'),
        ({'top': 'open'}, 'top=0.01', 'only the top is open, so that no flow depends on'),
        ({'top': 'closed'}, 'left=0.01', 'beyond the left side, which is closed; open sides: none'),
    ],
)
def test_a_rise_without_consequence_is_refused(make_rig, boundaries, effect, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        physics_of(make_rig(boundaries=boundaries), f'water_level:{effect}')


@pytest.mark.parametrize(
    ('open_sides', 'fitted'),
    [
        ((), []),
        (('top',), []),
        (('left', 'right'), [['left']]),
        (('top', 'left', 'right'), [['top', 'left']]),
    ],
)
def test_all_rises_but_one_are_fitted(make_rig, open_sides, fitted) -> None:
    sides = dict.fromkeys(('top', 'bottom', 'left', 'right'), 'closed')
    rig = make_rig(boundaries=Boundaries(**{**sides, **dict.fromkeys(open_sides, 'open')}))
    context = SearchContext(rig, rig.grid(31, 19), 3600.0)
    found = EFFECTS['water_level'].candidates(context)
    assert [[parameter.name for parameter in c.parameters] for c in found] == fitted


def test_a_natural_step_moves_fronts_by_one_cell(make_rig) -> None:
    rig = make_rig(boundaries=RESERVOIRS)
    context = SearchContext(rig, rig.grid(31, 17), 3600.0)
    (candidate,) = EFFECTS['water_level'].candidates(context)
    (rise,) = candidate.parameters
    flux = background_flux(physics_of(rig, f'water_level:left={rise.value(1.0)}'))
    speed = flux.x[0, 0] / (0.010 * context.grid.dz * 0.375)
    assert speed * 3600.0 == pytest.approx(context.grid.dx, rel=1e-6)


def test_the_phrase_says_where_and_how_much() -> None:
    said = EFFECTS['water_level'].in_words({'left': 0.002, 'top': -0.001})
    assert '2 mm higher on the left and 1 mm lower at the top than described' in said


def test_the_adjoint_knows_the_slope(make_rig) -> None:
    rig = make_rig(boundaries={**RESERVOIRS, 'heads_m': {'left': 0.605, 'right': 0.60}})
    commanded = Schedule((ScheduleRow(0.0, 'injector', WellRate(from_ml_h(300.0), 1.0)),))
    grid = rig.grid(31, 17)
    weights = np.random.default_rng(3).random(grid.shape)
    setting = {'grid': grid, 'preset': 'fast'}

    def cost(rise: float) -> float:
        effect = parse_effect(f'water_level:left={rise}')
        (seen,) = simulate(rig, commanded, [900.0], effects=[effect], **setting)
        return float((weights * seen**2).sum())

    found = gradient(
        rig,
        commanded,
        [900.0],
        lambda _index, seen: (float((weights * seen**2).sum()), 2.0 * weights * seen),
        effects=[EffectDescription(name='water_level', parameters={'left': 0.001})],
        parameters=[('water_level', 'left')],
        **setting,
    )
    slope = (cost(0.001 + 1e-7) - cost(0.001 - 1e-7)) / 2e-7
    assert found.parameters[0] == pytest.approx(slope, rel=1e-4)
