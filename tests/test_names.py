"""Names: one name for one thing across packages, and tests that mirror the modules."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = [*sorted(path.parent.name for path in ROOT.glob('porotwin_*/setup.py')), 'lab']

SAME_CONCEPT = {
    '__init__.py': 'a package',
    '__main__.py': 'a package that runs',
    'registry.py': 'finds the files of an extension point',
}
"""File names that several packages may have, and the concept."""

SAME_CONCEPT_FOLDERS = {'checks', 'commands', 'effects', 'panels'}
"""Folders whose files are named after a check, a command, an effect or a panel, in any package."""

TESTS_WITHOUT_MODULE = {
    'test_bad_baselines.py': 'image and calibrate with the same bad baselines',
    'test_exact_solutions.py': 'the whole model against exact solutions',
    'test_other_protocols.py': 'three protocols of pumps by the same tests',
    'test_pump_stop.py': 'the whole twin when a pump stops',
    'test_remarks_about_maps.py': 'all checks together on maps',
    'test_remarks_about_rigs.py': 'all checks together on rigs',
    'test_same_remarks.py': 'all commands on one recording',
    'test_remarks_about_tables.py': 'all checks together on rates, times and lists',
    'test_real_photographs.py': 'the whole imaging on real photographs',
    'test_chart_panels.py': 'all small panels with a chart',
    'test_map_panels.py': 'all small panels with a map',
    'test_page_browser.py': 'the page in a browser',
    'test_web_scripts.py': 'runs the tests of the scripts in test/web',
    'test_rig_effects.py': 'all effects of the virtual rig',
    'test_rig_nodes.py': 'the virtual rig and the mock camera in one graph',
    'test_settings.py': 'the settings of all steps of the imaging',
    'test_shared_cases.py': 'the whole virtual rig against another simulator',
}
"""Tests of a package that belong to no single module, and the reason."""


def modules(package: str) -> list[Path]:
    folder = ROOT / package / package
    paths = folder.rglob('*.py') if folder.is_dir() else (ROOT / package).rglob('*.py')
    return sorted(path for path in paths if 'test' not in path.relative_to(ROOT).parts)


def test_no_file_name_stands_for_two_things() -> None:
    found = defaultdict(set)
    for package in PACKAGES:
        for path in modules(package):
            if path.parent.name not in SAME_CONCEPT_FOLDERS and path.name not in SAME_CONCEPT:
                found[path.name].add(package)
    twice = {name: sorted(where) for name, where in found.items() if len(where) > 1}
    assert not twice, f'two packages have a file of the same name: {twice}'


def test_no_class_name_stands_for_two_things() -> None:
    found = defaultdict(set)
    for package in PACKAGES:
        for path in modules(package):
            text = path.read_text(encoding='utf-8')
            for name in re.findall(r'^class ([A-Za-z]\w*)[(:[]', text, re.MULTILINE):
                found[name].add(str(path.relative_to(ROOT)))
    twice = {name: sorted(where) for name, where in found.items() if len(where) > 1}
    assert not twice, f'two modules have a class of the same name: {twice}'


@pytest.mark.parametrize('package', PACKAGES)
def test_a_modules_tests_carry_its_name(package: str) -> None:
    known = {path.stem.strip('_') for path in modules(package)}  # import_.py is the command import
    tests = (ROOT / package / 'test').rglob('test_*.py')
    lost = sorted(
        path.name
        for path in tests
        if path.stem.removeprefix('test_').removesuffix('_command') not in known
        and path.name not in TESTS_WITHOUT_MODULE
    )
    assert not lost, f'{package}/test: no module has the name of {lost}'
