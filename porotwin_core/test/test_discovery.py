"""Extension points: modules of a folder found by themselves."""

import importlib
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest

from porotwin_core.basis import discovery
from porotwin_core.basis.discovery import discovered, module_names
from porotwin_core.basis.errors import InputError


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A function that makes a package of modules and returns its name."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(name: str, **modules: str) -> str:
        (tmp_path / name).mkdir()
        (tmp_path / name / '__init__.py').write_text('')
        for module, text in modules.items():
            (tmp_path / name / f'{module}.py').write_text(text)
        return name

    yield make
    for name in [name for name in sys.modules if name.startswith('made_up')]:
        del sys.modules[name]


def test_every_module_is_found_by_its_name(package) -> None:
    name = package('made_up_whole', two='THING = 2', one='THING = 1', _helper='')
    assert module_names(name) == ['one', 'two']
    assert discovered(name, 'THING', int, 'the guide') == {'one': 1, 'two': 2}


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('', r'bad: must define THING = int\(...\); see the guide'),
        ("THING = 'text'", 'bad: must define THING'),
        ('THING = complex(1, 2, 3)', 'bad: .*argument.*; see the guide'),
    ],
)
def test_an_incomplete_module_is_refused_in_one_line(package, text, complaint) -> None:
    name = package('made_up_broken', bad=text)
    with pytest.raises(InputError, match=complaint) as refusal:
        discovered(name, 'THING', int, 'the guide')
    assert '\n' not in str(refusal.value)


def test_an_object_with_another_name_than_its_module_is_refused(package) -> None:
    text = 'from types import SimpleNamespace\nTHING = SimpleNamespace(name="other")\n'
    name = package('made_up_other', bad=text)
    with pytest.raises(InputError, match=r"bad: its THING has the name 'other'; see the guide"):
        discovered(name, 'THING', SimpleNamespace, 'the guide')


def test_a_name_may_have_dashes_where_its_module_has_underscores(package) -> None:
    text = 'from types import SimpleNamespace\nTHING = SimpleNamespace(name="two-words")\n'
    name = package('made_up_dashes', two_words=text)
    assert list(discovered(name, 'THING', SimpleNamespace, 'the guide')) == ['two-words']


def test_helpers_need_no_object(package) -> None:
    name = package('made_up_helped', thing='THING = 1', help_with_things='')
    found = discovered(name, 'THING', int, 'the guide', helpers=['help_with_things'])
    assert found == {'thing': 1}


def test_a_module_instead_of_a_package_is_refused() -> None:
    with pytest.raises(InputError, match='not a package'):
        module_names('porotwin_core.basis.errors')


@pytest.mark.parametrize(
    ('text', 'fault'), [('def (\n', 'SyntaxError'), ('raise SystemExit(0)', 'SystemExit')]
)
def test_a_module_that_cannot_be_imported_is_refused_with_one_line(
    tmp_path, monkeypatch, text, fault
) -> None:
    folder = tmp_path / 'broken_package'
    folder.mkdir()
    (folder / '__init__.py').write_text('')
    (folder / 'typo.py').write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, 'broken_package', raising=False)
    importlib.invalidate_caches()
    with pytest.raises(InputError, match=rf'broken_package\.typo: {fault}') as refusal:
        discovered('broken_package', 'THING', str, 'guide.md')
    assert '\n' not in str(refusal.value)


def test_another_distribution_adds_by_an_entry_point(package, monkeypatch) -> None:
    name = package('made_up_group', one='THING = 1')
    package('made_up_other', two='THING = 2')
    points = [EntryPoint('two', 'made_up_other.two:THING', name)]
    monkeypatch.setattr(discovery, 'installed', lambda _: points)
    assert discovered(name, 'THING', int, 'the guide') == {'one': 1, 'two': 2}
    twice = [EntryPoint('one', 'made_up_other.two:THING', name)]
    monkeypatch.setattr(discovery, 'installed', lambda _: twice)
    with pytest.raises(InputError, match='there is a one already'):
        discovered(name, 'THING', int, 'the guide')
    broken = [EntryPoint('two', 'made_up_nowhere:THING', name)]
    monkeypatch.setattr(discovery, 'installed', lambda _: broken)
    with pytest.raises(InputError, match=f'made_up_nowhere:THING of {name}: ModuleNotFound'):
        discovered(name, 'THING', int, 'the guide')
