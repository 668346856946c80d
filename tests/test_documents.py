"""The documents are true: their commands run, their links lead somewhere, their tables are new."""

import importlib
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

from porotwin_cli.app import app
from porotwin_core.geometry.grid import conservative_resample
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import ConcentrationWriter

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [*sorted(ROOT.glob('*.md')), *sorted((ROOT / 'docs').rglob('*.md'))]
MOST_WORDS = 40_000
"""Words that all documents may have together, so that one person can read them."""

LINK = re.compile(r'\[[^\]]*\]\(([^)#\s]+)[^)]*\)')
ANCHOR = re.compile(r'\[[^\]]*\]\(([^)#\s:]*)#([^)\s]+)\)')
HEADING = re.compile(r'^#+ (.*)$', re.MULTILINE)
MODULE = re.compile(r'\bporotwin_\w+(?:\.\w+)+')
PATH = re.compile(r'`((?:porotwin_\w+|tests|docs|setup)/[\w/.]+(?:/|\.\w+))`')
NEW_FILE = re.compile(r'^(?:#|//) file: (\S+)$', re.MULTILINE)
FOLDERS = re.compile(r'^\| `(porotwin_\w+)` \| ((?:`\w+`(?:, )?)+) \|$', re.MULTILINE)
SHELL = re.compile(r'^```sh\n(.*?)^```', re.MULTILINE | re.DOTALL)
PYTHON = re.compile(r'^```python\n(.*?)^```', re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize('document', DOCUMENTS, ids=lambda path: path.name)
def test_every_link_leads_to_a_file(document: Path) -> None:
    links = [link for link in LINK.findall(document.read_text(encoding='utf-8')) if ':' not in link]
    missing = [link for link in links if not (document.parent / link).exists()]
    assert not missing, f'{document.name}: broken links {missing}'


def test_a_person_can_read_all_documents() -> None:
    words = {
        str(path.relative_to(ROOT)): sum(
            any(letter.isalnum() for letter in word)
            for word in path.read_text(encoding='utf-8').split()
        )
        for path in DOCUMENTS
    }
    longest = Counter(words).most_common(5)
    total = sum(words.values())
    assert total <= MOST_WORDS, f'{total} words; shorten a page, the longest are {longest}'


@pytest.mark.parametrize('document', DOCUMENTS, ids=lambda path: path.name)
def test_every_anchor_is_a_heading(document: Path) -> None:
    for link, anchor in ANCHOR.findall(document.read_text(encoding='utf-8')):
        target = document.parent / link if link else document
        if target.suffix == '.md':
            headings = HEADING.findall(target.read_text(encoding='utf-8'))
            assert anchor in map(slug, headings), f'{document.name}: no heading {link}#{anchor}'


def slug(heading: str) -> str:
    """Return the anchor that a heading gets on the page, as GitHub makes it."""
    return re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')


@pytest.mark.parametrize('document', DOCUMENTS, ids=lambda path: path.name)
def test_every_named_module_and_file_exists(document: Path) -> None:
    text = document.read_text(encoding='utf-8')
    new = {*NEW_FILE.findall(text)}  # files that a page of docs/extend tells to write
    modules = {path.removesuffix('.py').partition('/')[2].replace('/', '.') for path in new}
    for name in set(MODULE.findall(text)) - modules:
        assert exists(name), f'{document.name}: no module {name}'
    for path in set(PATH.findall(text)) - new:
        assert (ROOT / path).exists(), f'{document.name}: no file {path}'


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, or something within a module."""
    parts = name.split('.')
    for length in range(len(parts), 0, -1):
        try:
            found = importlib.import_module('.'.join(parts[:length]))
        except ModuleNotFoundError:
            continue
        return length >= len(parts) - 1 and all(hasattr(found, part) for part in parts[length:])
    return False


def test_the_architecture_names_every_folder() -> None:
    text = (ROOT / 'ARCHITECTURE.md').read_text(encoding='utf-8')
    for package, folders in FOLDERS.findall(text):
        parents = (ROOT / package / package).glob('*/__init__.py')
        assert {path.parent.name for path in parents} == set(re.findall(r'\w+', folders)), package


@pytest.mark.slow
def test_the_commands_of_the_tutorial_run(tmp_path: Path, monkeypatch) -> None:
    text = (ROOT / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
    (tmp_path / 'bags').symlink_to(ROOT / 'bags')
    monkeypatch.chdir(tmp_path)
    for block in SHELL.findall(text):
        for line in filter(None, block.splitlines()):
            if ' simulate ' in line:
                coarsen(tmp_path / 'tour' / 'experiment')
            program, *words = line.split()
            assert program == './porotwin'
            ran = CliRunner().invoke(app, words, prog_name='porotwin', catch_exceptions=False)
            assert ran.exit_code == 0, f'{line}\n{ran.output}'
    for block in PYTHON.findall(text):
        subprocess.run([sys.executable, '-c', block], check=True, cwd=tmp_path)
    assert (tmp_path / 'tour' / 'comparison.png').stat().st_size > 10_000
    assert (tmp_path / 'tour' / 'diagnosis' / 'report.html').is_file()


def coarsen(folder: Path) -> None:
    """Replace the maps of an experiment by coarse ones: its model and diagnosis take seconds."""
    recording = open_recording(folder)
    assert recording.maps is not None
    grid = recording.rig.grid(31, 19)
    with ConcentrationWriter(folder / 'coarse.nc', grid) as writer:
        for time, values in zip(recording.times, recording.maps, strict=True):
            writer.append(float(time), conservative_resample(values, grid.shape))
    (folder / 'coarse.nc').replace(folder / 'concentration.nc')


@pytest.mark.graph
def test_the_page_of_the_nodes_is_up_to_date() -> None:
    command = [sys.executable, 'docs/make_nodes.py', '--check']
    ran = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    assert ran.returncode == 0, 'docs/nodes.md is old: run python docs/make_nodes.py'


@pytest.mark.slow
def test_the_api_pages_are_built_from_the_docstrings(tmp_path: Path) -> None:
    # one small package: all take half a minute
    packages = ['porotwin_pumps']
    command = [sys.executable, 'docs/make_api.py', str(tmp_path / 'site'), *packages]
    ran = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    assert ran.returncode == 0, ran.stderr
    page = (tmp_path / 'site' / 'porotwin_pumps' / 'pump_file.html').read_text(encoding='utf-8')
    assert 'load_pumps' in page
