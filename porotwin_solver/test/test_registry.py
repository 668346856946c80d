"""The registry of effects: finds every module, in order, and reads effects from text."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from porotwin_core.basis.discovery import module_names
from porotwin_core.basis.errors import InputError
from porotwin_solver import effects
from porotwin_solver.effects import (
    EFFECTS,
    described_changes,
    described_physics,
    effects_of,
    observation_operator,
    parse_effect,
    physics_on_top,
)
from porotwin_solver.effects.definition.effect import Scope
from porotwin_solver.effects.definition.registry import summary

CONTRACT = {
    'numerical_diffusion': {'model_diffusion': 'm2/s'},
    'dispersion': {
        'longitudinal_dispersivity': 'm',
        'transverse_dispersivity': 'm',
        'diffusion': 'm2/s',
    },
    'buoyancy': {'density_difference': 'kg/m3'},
    'viscosity': {'viscosity_ratio': '-'},
    'retardation': {'retardation_factor': '-'},
    'decay': {'rate': '1/s'},
    'dual_porosity': {'immobile_fraction': '-', 'exchange_rate': '1/s'},
    'heterogeneity': {'x': 'm', 'z': 'm', 'radius': 'm', 'permeability_factor': '-'},
    'porosity': {'factor': '-'},
    'depth': {'factor_centre': '-'},
    'rate': {'well': 'name', 'factor': '-'},
    'well_position': {'well': 'name', 'dx': 'm', 'dz': 'm'},
    'leak': {'x': 'm', 'z': 'm', 'rate': 'ml/h'},
    'background_flow': {'x_velocity': 'm/s', 'z_velocity': 'm/s'},
    'saturation': {'exponent': '-'},
    'illumination': {'drift': '1/s', 'gradient': '1/m'},
    'registration': {'dx': 'm', 'dz': 'm', 'rotation': 'rad', 'scale': '-'},
    'clock': {'offset': 's'},
}
"""Names that files of recordings and diagnoses hold, so that they must stay as they are."""


def test_names_parameters_units_and_order_stay_as_files_hold_them() -> None:
    found = {name: {key: p.unit for key, p in e.parameters.items()} for name, e in EFFECTS.items()}
    assert all(found[name].items() >= units.items() for name, units in CONTRACT.items())
    added = [(n, key) for n, units in CONTRACT.items() for key in found[n].keys() - units.keys()]
    assert all(EFFECTS[name].parameters[key].default is not None for name, key in added)
    assert [name for name in found if name in CONTRACT] == list(CONTRACT)


def test_every_module_of_the_folder_is_an_effect() -> None:
    assert sorted(EFFECTS) == module_names('porotwin_solver.effects')
    assert [effect.name for effect in effects_of(Scope.WELL)] == [
        'rate',
        'stock_strength',
        'dead_volume',
        'well_position',
    ]


@pytest.mark.parametrize('name', EFFECTS)
def test_every_effect_says_in_one_line_what_it_is(name) -> None:
    assert summary(EFFECTS[name]).endswith(('.', ',', "C the rig's middle."))


@pytest.mark.parametrize(
    ('text', 'fault'),
    [
        ('', r'brine: must define EFFECT = Effect\(...\); see docs/extend/effect.md'),
        ("EFFECT = Effect(name='brine')", "brine: .*missing 4 required .*'phrase'"),
    ],
)
def test_a_module_that_is_no_effect_is_refused_at_import(tmp_path: Path, text, fault) -> None:
    """A copy of the package with one more module, imported in a process of its own."""
    package = Path(effects.__file__).parents[1]
    subprocess.run(['cp', '-r', str(package), str(tmp_path)], check=True)
    head = 'from porotwin_solver.effects.definition.effect import Effect\n'
    (tmp_path / package.name / 'effects' / 'brine.py').write_text(head + text)
    code = (
        'import sys; sys.path.insert(0, sys.argv[1])\n'
        'from porotwin_core.basis.errors import InputError\n'
        'try:\n    import porotwin_solver.effects\n'
        'except InputError as error:\n    print(error)\n'
    )
    run = [sys.executable, '-c', code, str(tmp_path)]
    said = subprocess.run(run, check=True, capture_output=True, text=True).stdout
    assert len(said.splitlines()) == 1
    with pytest.raises(InputError, match=fault):
        raise InputError(said)


def test_an_effect_is_written_on_a_command_line() -> None:
    found = parse_effect('dispersion:longitudinal_dispersivity=0.004,transverse_dispersivity=4e-4')
    assert found.name == 'dispersion'
    assert found.parameters == {
        'longitudinal_dispersivity': 0.004,
        'transverse_dispersivity': 0.0004,
        'diffusion': 1e-9,
    }
    assert parse_effect('rate:well=producer,factor=0.99').parameters['well'] == 'producer'
    for text, remark in (
        ('decay:rate', 'write NAME:PARAM=VALUE,PARAM=VALUE'),
        ('colour:x=1', "effect 'colour': unknown; choose from"),
        ('decay:rate=fast', "rate = 'fast': give a number"),
        ('decay', "parameter 'rate' .* is missing"),
        ('water_level', 'changes nothing; give some of top, bottom, left, right'),
    ):
        with pytest.raises(InputError, match=remark):
            parse_effect(text)


def test_changes_add_to_what_the_physics_has_and_factors_multiply(rig) -> None:
    had = described_physics(
        rig,
        rig.grid(20, 12),
        [
            EFFECTS['buoyancy'].described(density_difference=1.0),
            EFFECTS['dispersion'].described(
                longitudinal_dispersivity=1e-3, transverse_dispersivity=1e-4, diffusion=2e-9
            ),
            EFFECTS['retardation'].described(retardation_factor=1.5),
        ],
    )
    changes = [
        EFFECTS['buoyancy'].described(density_difference=0.5),
        EFFECTS['dispersion'].described(longitudinal_dispersivity=2e-3),
        EFFECTS['retardation'].described(retardation_factor=0.8),
        EFFECTS['clock'].described(offset=20.0),
    ]
    found = physics_on_top(had, changes)
    assert found.density_difference == 1.5
    assert found.longitudinal_dispersivity == pytest.approx(3e-3)
    assert (found.transverse_dispersivity, found.diffusion) == (1e-4, 2e-9)
    assert found.retardation_factor == pytest.approx(1.2)


def test_described_effects_do_the_same_as_changes(rig) -> None:
    own = rig.with_effects(
        [
            EFFECTS['buoyancy'].described(density_difference=1.0),
            EFFECTS['retardation'].described(retardation_factor=1.5),
        ]
    )
    effects = [
        EFFECTS['buoyancy'].described(density_difference=3.0),
        EFFECTS['retardation'].described(retardation_factor=1.2),
        parse_effect('dispersion:longitudinal_dispersivity=2e-3,transverse_dispersivity=1e-4'),
        parse_effect('viscosity:viscosity_ratio=1.5'),
    ]
    grid = own.grid(20, 12)
    changes = described_changes(own, grid, effects)
    assert changes[0].parameters == {'density_difference': 2.0}
    assert 'diffusion' not in changes[2].parameters, 'it stays'
    wanted = described_physics(own, grid, effects)
    found = physics_on_top(described_physics(own, grid), changes)
    for name in ('density_difference', 'viscosity_ratio', 'longitudinal_dispersivity', 'diffusion'):
        assert getattr(found, name) == getattr(wanted, name)
    assert np.array_equal(found.retardation_factor, wanted.retardation_factor)


@pytest.mark.parametrize('along', [-2e-3, 200.0])
def test_a_change_to_what_no_rig_can_have_is_refused(rig, along) -> None:
    change = EFFECTS['dispersion'].described(longitudinal_dispersivity=along)
    with pytest.raises(InputError, match='longitudinal_dispersivity'):
        physics_on_top(described_physics(rig, rig.grid(20, 12)), [change])


@pytest.mark.parametrize('name', EFFECTS)
def test_what_is_believed_lies_in_the_range_of_the_effect(name, rig) -> None:
    for candidate in EFFECTS[name].believed(rig):
        for sign in (-3.0, 0.0, 3.0):
            drawn = candidate.described([sign] * len(candidate.parameters))
            physics_on_top(described_physics(rig, rig.grid(20, 12)), [drawn])


def test_an_onset_that_is_no_number_is_refused() -> None:
    late = EFFECTS['registration'].described(dx=0.01, since='noon')
    with pytest.raises(InputError, match="since = 'noon': give a number"):
        observation_operator([late])
