"""The registry of effects: finds every module, in order, and reads effects from text."""

import subprocess
import sys
from pathlib import Path

import pytest

from porotwin_core.basis.discovery import module_names
from porotwin_core.basis.errors import InputError
from porotwin_solver import effects
from porotwin_solver.effects import EFFECTS, effects_of, parse_effect
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
    assert {name: found[name] for name in CONTRACT} == CONTRACT
    assert [name for name in found if name in CONTRACT] == list(CONTRACT)


def test_every_module_of_the_folder_is_an_effect() -> None:
    assert sorted(EFFECTS) == module_names('porotwin_solver.effects')
    assert [effect.name for effect in effects_of(Scope.WELL)] == ['rate', 'well_position']


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
