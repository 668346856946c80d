"""Tests of docs/rig.md: its examples are valid rigs, and it names every key and objective."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from porotwin_core.basis.units import HOUR_S
from porotwin_core.rig import Control, Rig, load_rig
from porotwin_core.rig.known_keys import SECTIONS, json_schema
from porotwin_core.rig.oddities import remarks_about
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.objectives.objective_registry import OBJECTIVES, make_objective
from porotwin_recording.experiment.recording import odd_lines, open_recording
from porotwin_solver.model.simulation import simulate
from porotwin_solver.service.effects_in_force import checked_effects

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = (ROOT / 'docs' / 'rig.md').read_text(encoding='utf-8')
RIGS = sorted(path.parent.name for path in ROOT.glob('rigs/*/rig.yaml'))


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
    folders = sorted(path.parent for path in examples.glob('*/rig.yaml'))
    assert [folder.name for folder in folders] == ['layered', 'small']
    for folder in [*folders, ROOT / 'rigs' / 'two_sands']:
        rig = load_rig(folder)
        limits = Limits.of(rig)
        assert limits.violations(limits.safe()) == []
        make_objective(rig, rig.default_grid())


def test_the_small_rig_is_the_one_that_ships(examples: Path) -> None:
    shipped = load_rig(ROOT / 'porotwin_hub' / 'config' / 'small_rig.yaml')
    assert load_rig(examples / 'small').model_copy(update={'camera': None}) == shipped


def test_the_document_shows_a_rig_that_ships(examples: Path) -> None:
    shown = (examples / 'small' / 'rig.yaml').read_text(encoding='utf-8')
    assert shown == (ROOT / 'rigs' / 'small' / 'rig.yaml').read_text(encoding='utf-8')


SHOWN_OBJECTIVES = re.findall(r'```yaml\n(objective:.*?)```', DOCUMENT, re.DOTALL)


@pytest.mark.parametrize('text', SHOWN_OBJECTIVES)
def test_the_shown_objectives_are_valid(text: str) -> None:
    rig = load_rig(ROOT / 'rigs' / 'small' / 'rig.yaml')
    assert rig.control is not None
    section = {**rig.control.model_dump(), **yaml.safe_load(text), 'disallowed_zone_m': ()}
    control = Control.model_validate(section)
    grid = rig.grid(62, 37)
    objective = make_objective(rig.model_copy(update={'control': control}), grid)
    assert objective.goal
    for term in objective.terms(0.0, 4800.0):
        term.check(grid.shape, 4800.0)


def test_every_objective_is_shown() -> None:
    shown = {yaml.safe_load(text)['objective']['name'] for text in SHOWN_OBJECTIVES}
    assert set(OBJECTIVES) - shown == {'least_water'}  # a part of the sum


SHOWN_EFFECTS = re.findall(
    r'```yaml\n(effects:.*?)```',
    DOCUMENT + (ROOT / 'docs' / 'effects.md').read_text(encoding='utf-8'),
    re.DOTALL,
)


MILK = {'pennink_milk', 'pennink_rain'}
"""Rigs whose tracer also enters or leaves with other water than that of wells."""


def test_a_document_shows_effects() -> None:
    assert SHOWN_EFFECTS


@pytest.mark.parametrize('text', SHOWN_EFFECTS)
def test_the_shown_effects_complete_a_rig(text: str, tmp_path: Path) -> None:
    shipped = (ROOT / 'rigs' / 'small' / 'rig.yaml').read_text(encoding='utf-8')
    (tmp_path / 'rig.yaml').write_text(f'{shipped}\n{text}', encoding='utf-8')
    rig = load_rig(tmp_path)
    assert [effect.name for effect in rig.effects] == ['rate', 'leak']
    assert checked_effects(rig, rig.effects) == rig.effects


def test_there_are_rigs_to_copy() -> None:
    assert RIGS == ['large', 'pennink_1904', 'pennink_milk', 'pennink_rain', 'small', 'two_sands']


@pytest.mark.parametrize('name', RIGS)
def test_a_rig_to_copy_is_not_odd_and_can_be_simulated(name: str) -> None:
    recording = open_recording(ROOT / 'rigs' / name)
    rig = recording.rig
    assert remarks_about(rig) == ()
    assert odd_lines([recording]) == []
    rows = recording.delivered.rows
    last = min(rows[-1].time, 4.0 * HOUR_S) if rows else HOUR_S
    grid = rig.default_grid(0.02 if rig.water else 0.05)  # a canal is 5 cm wide
    tracer = simulate(rig, recording.delivered, [last], grid=grid, preset='fast')[0]
    pores = rig.field('porosity', grid) * rig.field('depth_m', grid) * grid.cell_area
    periods = recording.delivered.intervals(0.0, last)
    pumped = sum(
        (end - start) * max(well.rate, 0.0) * well.concentration
        for start, end, rates in periods
        for well in rates.values()
    )
    assert tracer.min() >= 0.0
    assert tracer.max() <= 1.0
    if name not in MILK:
        assert (tracer * pores).sum() == pytest.approx(pumped, rel=0.1)


@pytest.mark.parametrize('name', RIGS)
def test_a_rig_with_sands_survives_the_way_through_a_message(name: str) -> None:
    conversions = pytest.importorskip('porotwin_core.ros.conversions')
    rig = load_rig(ROOT / 'rigs' / name)
    again = conversions.rig_from_msg(conversions.rig_to_msg(rig))
    assert again.physics_fingerprint == rig.physics_fingerprint


def test_the_schema_is_up_to_date() -> None:
    written = json.loads((ROOT / 'docs' / 'rig.schema.json').read_text(encoding='utf-8'))
    assert written == json.loads(json.dumps(json_schema())), 'run python docs/make_rig_schema.py'


def test_the_schema_accepts_a_rate_with_its_unit() -> None:
    sections = json_schema()['$defs']

    def kinds_of(value: dict[str, Any]) -> list[dict[str, Any]]:
        parts = [*value.get('anyOf', []), *value.get('prefixItems', [])]
        own = [value] if 'number' in value.get('type', []) else []
        return own + [kind for part in parts for kind in kinds_of(part)]

    rates = {
        key: kinds_of(value)
        for section in sections.values()
        for key, value in section.get('properties', {}).items()
        if 'ml_h' in key
    }
    assert rates
    assert all('string' in kind['type'] for kinds in rates.values() for kind in kinds), rates
    assert all(rates.values())


@pytest.mark.parametrize('name', RIGS)
def test_the_schema_knows_every_key_of_the_rigs(name: str) -> None:
    text = (ROOT / 'rigs' / name / 'rig.yaml').read_text(encoding='utf-8')
    first, schema = text.splitlines()[0], ROOT / 'docs' / 'rig.schema.json'
    assert (ROOT / 'rigs' / name / first.partition('$schema=')[2]).resolve() == schema
    properties = json.loads(schema.read_text(encoding='utf-8'))['properties']
    assert yaml.safe_load(text).keys() <= properties.keys()
    assert all('description' in keys for keys in properties.values())


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
