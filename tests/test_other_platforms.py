"""Files for machines that are not here: no engine and no viewer ran them, but they are whole."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from test_without_ros import ALGORITHMS, dotted

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / 'porotwin_bringup' / 'config'

STUB = """
import importlib, importlib.abc, json, os, sys

class Elsewhere(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {gone!r}:
            raise ModuleNotFoundError('not on this platform: ' + name, name=name)

for name in {gone!r}:
    sys.modules.pop(name, None)
for name in ('O_NOFOLLOW', 'O_NONBLOCK', 'geteuid', 'getuid'):
    delattr(os, name)
sys.meta_path.insert(0, Elsewhere())
failures = {{}}
for name in {names!r}:
    try:
        importlib.import_module(name)
    except Exception as error:
        failures[name] = repr(error)
print(json.dumps(failures))
"""

ONLY_UNIX = {'fcntl', 'termios', 'pty', 'tty', 'pwd', 'grp'}


@pytest.mark.slow
def test_the_library_is_imported_where_there_is_no_unix() -> None:
    script = STUB.format(
        gone=sorted(ONLY_UNIX | {'rclpy'}), names=[dotted(one) for one in ALGORITHMS]
    )
    ran = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True, check=True)
    assert json.loads(ran.stdout.splitlines()[-1]) == {}


def test_the_layouts_of_viewers_name_topics_of_the_twin() -> None:
    nodes = (ROOT / 'docs' / 'nodes.md').read_text(encoding='utf-8')
    layout = (CONFIG / 'foxglove.json').read_text(encoding='utf-8')
    json.loads(layout)
    rviz = (CONFIG / 'twin.rviz').read_text(encoding='utf-8')
    assert yaml.safe_load(rviz)['Visualization Manager']['Global Options']['Fixed Frame'] == 'rig'
    for text in (layout, rviz):
        topics = re.findall(r'/porotwin/([a-z_]+/[a-z_]+)', text)
        assert len(topics) >= 3
        assert [topic for topic in topics if f'`{topic}`' not in nodes] == []


def test_pixi_asks_for_the_versions_of_pip() -> None:
    pixi = tomllib.loads((ROOT / 'pixi.toml').read_text(encoding='utf-8'))
    texts = [path.read_text() for path in (ROOT / 'setup' / 'requirements').glob('*.txt')]
    bounds = dict(re.findall(r'^([\w.-]+)(>=[\w.]+)$', '\n'.join(texts).lower(), re.MULTILINE))
    asked = {**pixi['dependencies']}
    asked['matplotlib'] = asked.pop('matplotlib-base')
    assert {name: bound for name, bound in asked.items() if name not in ('python', 'pip')} == {
        name: bounds[name] for name in asked if name in bounds
    }


def test_the_image_takes_files_that_exist() -> None:
    docker = (ROOT / '.devcontainer' / 'Dockerfile').read_text(encoding='utf-8')
    for name in re.findall(r'(?:COPY|-r) ([\w./]+\.(?:sh|txt))', docker):
        assert (ROOT / name).is_file(), name
    container = json.loads((ROOT / '.devcontainer' / 'devcontainer.json').read_text())
    assert (ROOT / '.devcontainer' / container['build']['dockerfile']).is_file()
    assert 'twin.launch.py' in docker


def test_a_release_checks_its_tag_and_runs_all_tests_first() -> None:
    release = yaml.safe_load((ROOT / '.github' / 'workflows' / 'release.yml').read_text())
    steps = [step.get('run', '') for step in release['jobs']['release']['steps']]
    tested = steps.index('.ci/run')
    assert any('GITHUB_REF_NAME' in step for step in steps[:tested])
    assert all('publish' not in step for step in steps[:tested])


def test_a_release_publishes_only_what_pip_builds() -> None:
    release = yaml.safe_load((ROOT / '.github' / 'workflows' / 'release.yml').read_text())
    steps = release['jobs']['release']['steps']
    (published,) = [
        step['with']['packages-dir'] for step in steps if 'pypi' in step.get('uses', '')
    ]
    runs = [step['run'] for step in steps if f'{published}/' in step.get('run', '')]
    assert len(runs) == 1
    assert runs[0].startswith('gh release create')
    pages = release['jobs']['pages']
    assert (pages['needs'], pages['environment']['name']) == ('release', 'github-pages')
