"""Effects are known by their definitions: no rule compares with the name of one."""

import ast
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

from porotwin_rig.effects import EFFECTS as RIG_EFFECTS
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects import EFFECTS

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for path in ROOT.glob('porotwin_*/setup.py'))
MODULES = [
    path
    for package in PACKAGES
    for path in sorted((package / package.name).rglob('*.py'))
    if 'effects' not in path.relative_to(package).parts
]

NAMES = {*EFFECTS, *RIG_EFFECTS}

WORDS = {
    *(field.name for field in fields(Physics)),
    *(name for effect in EFFECTS.values() for name in effect.parameters),
}
"""Names of coefficients and parameters. Where an effect is called alike, only an asking for the
effect counts."""

OTHER_USES = {
    ('porotwin_core/rig/description.py', 'water_table'): 'a key of rig.yaml',
    ('porotwin_recording/importers/protocol_rates.py', 'clock'): 'an answer to an import',
    ('porotwin_core/ros/from_messages.py', 'water_table'): 'a key of rig.yaml',
}
"""Texts that are names of effects by chance, and their meanings."""


def texts(node: ast.AST) -> Iterator[str]:
    """Yield the texts below a node, which may be a tuple, a list or a set of them."""
    yield from (one.value for one in ast.walk(node) if isinstance(one, ast.Constant))


def asked(tree: ast.AST) -> Iterator[str]:
    """Yield the texts that ask for an effect: by subscript, argument, keyword or comparison."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith('EFFECTS'):
            yield from texts(node.slice)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ('effect', 'parse_effect'):
            yield from (text for argument in node.args for text in texts(argument))
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == 'EffectDescription':
            yield from (text for key in node.keywords if key.arg == 'name' for text in texts(key))
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            attributes = {one.attr for one in sides if isinstance(one, ast.Attribute)}
            if attributes & {'name', 'effect', 'members', 'combination'}:
                yield from (text for side in sides for text in texts(side))


def named(source: str) -> set[str]:
    """Return the names of effects that the source of a module names as text."""
    tree = ast.parse(source)
    return ({*texts(tree)} & (NAMES - WORDS)) | ({*asked(tree)} & NAMES)


def test_no_rule_names_an_effect() -> None:
    """A name is a property that the definition of the effect lacks."""
    found = {
        ('/'.join(module.parts[-3:]), name)
        for module in MODULES
        for name in named(module.read_text(encoding='utf-8'))
    }
    assert found <= set(OTHER_USES)


@pytest.mark.parametrize(
    ('source', 'name'),
    [
        ("found = [one for one in effects if one.name == 'leak']", 'leak'),
        ("check = EFFECTS['rate'].laboratory_check", 'rate'),
        ("EffectDescription(name='porosity', parameters={})", 'porosity'),
        ("rig.field('porosity', grid); row['rate']", None),
    ],
)
def test_what_counts_as_a_name(source: str, name: str | None) -> None:
    assert named(source) == {name} - {None}
