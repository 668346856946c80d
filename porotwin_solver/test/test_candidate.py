"""Scaled parameters of candidates, and the candidates of every effect on the small rig."""

import pytest

from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter, SearchContext

EXPECTED = {
    'dispersion': [0.25, 0.4, 0.25],
    'buoyancy': [0.16144688],
    'viscosity': [0.1],
    'retardation': [0.015],
    'decay': [0.03 / 3600.0],
    'dual_porosity': [0.3, 0.5],
    'heterogeneity': [0.003736, 0.003736, 0.1, 0.3],
    'porosity': [0.015],
    'depth': [0.02],
    'rate': [0.02],
    'well_position': [0.0024973262, 0.0024973262],
    'leak': [0.006071, 0.006071, 8.0],
    'background_flow': [5.2027629e-07, 5.2027629e-07],
    'saturation': [0.1],
    'illumination': [0.03 / 3600.0, 0.064239829],
    'registration': [0.001997861, 0.001997861, 0.010695187, 0.010695187],
    'clock': [36.0],
}
"""Natural steps of an hour on the small rig with cells of 5 mm."""


def test_scaled_parameters_and_values_are_inverse() -> None:
    for parameter in (
        FitParameter('a', 'm', 2.0, 0.3),
        FitParameter('b', '-', 2.0, 0.3, low=0.1, log=True),
    ):
        assert parameter.value(parameter.scaled(3.7)) == pytest.approx(3.7)
    assert FitParameter('c', '-', 1.0, 0.1, low=1.0).value(-5.0) == 1.0


def test_a_positive_strength_is_never_absent() -> None:
    strength = FitParameter('a', 'm', 1e-3, 0.25, log=True)
    factor = FitParameter('b', '-', 1.0, 0.25, log=True)
    assert strength.is_never_absent and strength.absent == 0.0
    assert not factor.is_never_absent and factor.absent == 1.0
    assert not Candidate('decay', (strength,)).is_absent([0.0])
    assert Candidate('decay', (factor,)).is_absent([0.0])
    assert not Candidate('decay', (factor,)).is_absent([0.1])


def test_natural_steps_follow_from_rig_cells_and_duration(rig) -> None:
    grid = rig.grid(187, 112)
    context = SearchContext(rig, grid, 3600.0, ('injector',), 1.4e-7, well='injector')
    steps = {
        name: [parameter.step for c in effect.candidates(context) for parameter in c.parameters]
        for name, effect in EFFECTS.items()
        if name in EXPECTED
    }
    assert list(steps) == list(EXPECTED)
    for name, expected in EXPECTED.items():
        assert steps[name] == pytest.approx(expected, rel=1e-6), name


def test_a_rig_without_an_open_side_has_no_leak(make_rig) -> None:
    from porotwin_core.rig import Boundaries

    rig = make_rig(boundaries=Boundaries(top='closed'))
    context = SearchContext(rig, rig.grid(31, 19), 3600.0, ('injector',), well='injector')
    without = {name for name, effect in EFFECTS.items() if not effect.candidates(context)}
    assert without & EXPECTED.keys() == {'leak'}
