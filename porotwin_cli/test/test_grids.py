"""Tests of --grid and of the time that a command tells before long work."""

import pytest

from porotwin_cli.options.grids import coupled_flow_seconds, grid_of, tell_cost
from porotwin_cli.workspace import small_rig
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.effects import changed_physics, parse_effects
from porotwin_solver.model.prediction_cost import prediction_cost

RIG = load_rig(small_rig())


def test_without_a_text_the_cells_measure_5_mm() -> None:
    assert str(grid_of('', RIG)) == '187x112'


def test_a_grid_that_cannot_be_computed_is_refused_with_a_better_one() -> None:
    with pytest.raises(InputError, match='187x112 has square cells of 5 mm'):
        grid_of('100000x5', RIG)


@pytest.mark.parametrize(('times', 'told'), [(1, False), (1_000_000, True)])
def test_long_work_is_told_before_it_begins(
    times: int, told: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    cost = prediction_cost(RIG, RIG.default_grid(), duration=30.0)
    tell_cost(cost, 'training pairs', times)
    assert ('training pairs: 20,944 cells, about' in capsys.readouterr().err) is told


def test_cells_of_a_finer_preset_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    cost = prediction_cost(RIG, RIG.grid(20, 12), preset='accurate', duration=30.0)
    tell_cost(cost, 'simulation', 1_000_000)
    assert f'after the preset divides each in {cost.refinement}x' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('effect', 'several'), [('buoyancy:density_difference=5', True), ('decay:rate=1e-5', False)]
)
def test_a_flow_that_follows_the_tracer_takes_longer(effect: str, several: bool) -> None:
    physics = nominal_physics(RIG, RIG.default_grid())
    physics = changed_physics(physics, parse_effects([effect]))
    assert (coupled_flow_seconds(physics, 1000) > 1.0) is several
