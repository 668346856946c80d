"""Tests of docs/rig.md: its examples are valid rigs, and it names every key and objective."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from porotwin_core.rig import (
    Boundaries,
    Camera,
    Control,
    EffectDescription,
    FixedWell,
    Rig,
    Well,
    load_rig,
)
from porotwin_hub.objective_registry import OBJECTIVES, make_objective
from porotwin_hub.setpoint_limits import Limits

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = (ROOT / 'docs' / 'rig.md').read_text(encoding='utf-8')
SECTIONS = (Rig, Boundaries, Well, Camera, Control, FixedWell, EffectDescription)


@pytest.fixture(scope='module')
def examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file of the document; its scripts have run in their folders."""
    folder = tmp_path_factory.mktemp('examples')
    for name, text in re.findall(r'```\w+\n# file: (\S+)\n(.*?)```', DOCUMENT, re.DOTALL):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding='utf-8')
        if path.suffix == '.py':
            subprocess.run([sys.executable, path.name], cwd=path.parent, check=True)
    return folder


def test_the_examples_are_rigs_that_can_be_controlled(examples: Path) -> None:
    folders = sorted(path.parent.name for path in examples.glob('*/rig.yaml'))
    assert folders == ['layered', 'small']
    for folder in folders:
        rig = load_rig(examples / folder)
        limits = Limits.of(rig)
        assert limits.violations(limits.safe()) == []
        make_objective(rig, rig.default_grid())


def test_the_small_rig_is_the_one_that_ships(examples: Path) -> None:
    shipped = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    assert load_rig(examples / 'small').model_copy(update={'camera': None}) == shipped


def test_the_permeability_map_has_a_layer_of_fine_sand(examples: Path) -> None:
    rig = load_rig(examples / 'layered')
    permeability = rig.field('permeability_m2', rig.grid(60, 40))
    assert permeability[20].max() == pytest.approx(5.0e-11)
    assert permeability[10].min() == pytest.approx(1.0e-9)


@pytest.mark.parametrize('section', SECTIONS, ids=lambda section: section.__name__)
def test_every_key_is_described(section: type[Rig]) -> None:
    missing = [name for name in section.model_fields if f'`{name}`' not in DOCUMENT]
    assert not missing


@pytest.mark.parametrize('name', ['keep_out', 'keep_in'])
def test_the_shipped_objectives_are_described_with_their_parameters(name: str) -> None:
    row = next(line for line in DOCUMENT.splitlines() if line.startswith(f'| `{name}` |'))
    assert all(f'`{key}`' in row for key in OBJECTIVES[name].parameters.model_fields)
