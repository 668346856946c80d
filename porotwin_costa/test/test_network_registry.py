"""The architectures: found by themselves, chosen by name, described in files."""

import importlib
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_costa import networks
from porotwin_costa.networks import ARCHITECTURES, architecture

OURS = ('local', 'paper', 'paper-complex')


def test_every_module_with_an_architecture_is_found():
    files = sorted(path.stem for path in Path(networks.__path__[0]).glob('*.py'))
    modules = [importlib.import_module(f'{networks.__name__}.{name}') for name in files]
    defined = [module.ARCHITECTURE for module in modules if hasattr(module, 'ARCHITECTURE')]
    assert list(ARCHITECTURES.values()) == defined
    assert [name for name in ARCHITECTURES if name in OURS] == list(OURS)
    assert all(found.name == name for name, found in ARCHITECTURES.items())
    assert all('\n' not in found.summary and found.summary for found in ARCHITECTURES.values())


def test_the_hybrid_is_the_default():
    assert architecture() is architecture('hybrid')


def test_an_unknown_name_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"'unknown'") as refusal:
        architecture('unknown')
    assert str(refusal.value).endswith(', '.join(ARCHITECTURES))
    with pytest.raises(InputError, match='transformer'):
        architecture('transformer')


@pytest.mark.parametrize('name', ARCHITECTURES)
def test_description_gives_the_architecture_back(name):
    chosen = architecture(name)
    description = chosen.description()
    assert description['architecture'] == name
    assert chosen.described(description) == chosen


@pytest.mark.parametrize('name', OURS)
def test_description_can_change_a_setting(name):
    chosen = architecture(name)
    description = chosen.description()
    smaller = chosen.described({'filters': 3})
    assert smaller.settings.filters == 3
    assert smaller.description() == {**description, 'filters': 3}
