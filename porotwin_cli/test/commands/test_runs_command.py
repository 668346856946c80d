"""Tests of ./porotwin runs."""

import json
import os
import re
import shutil
from pathlib import Path

import pytest
from cli_examples import porotwin, porotwin_process
from typer.testing import CliRunner

from porotwin_cli.app import app
from porotwin_cli.commands.runs import _columns, size_words
from porotwin_recording.experiment.catalogue import CatalogueEntry

SAMPLE = Path(__file__).resolve().parents[3] / 'bags' / 'sample'


def test_recordings_are_listed_and_a_broken_one_does_not_stop_the_list(tmp_path: Path) -> None:
    shutil.copytree(SAMPLE, tmp_path / 'morning' / 'sample')
    os.utime(tmp_path / 'morning' / 'sample' / 'bag_0.mcap', (1.7e9, 1.7e9))
    (tmp_path / 'broken.mcap').write_text('no bag')
    told = porotwin('runs', tmp_path)
    assert told.returncode == 0, told.stderr
    assert '1 recording in' in told.stdout
    assert 'morning/sample' in told.stdout
    assert f'{tmp_path}/broken.mcap: not an MCAP file' in told.stderr
    found = json.loads(porotwin('runs', tmp_path, '--json').stdout)['recordings']
    (sample,) = [entry for entry in found if entry['state'] == 'complete']
    assert (sample['photographs'], sample['maps'], sample['setpoints']) == (13, 13, 13)
    assert sample['duration_s'] == 360.0
    assert sample['rig'] == 'small'
    assert sample['start'] is None
    assert sample['date'] == sample['files_date'] == '2023-11-14T22:13:20+00:00'
    assert '2023-11-14 22:13†' in told.stdout
    assert '† date of its files' in told.stdout
    assert 'complete‡' in told.stdout
    assert '‡ of a bag' in told.stdout


def test_no_runs_yet_is_no_mistake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ['runs'])
    words = f'no runs yet in {tmp_path / "runs"}; name a folder with recordings, such as .'
    assert result.exit_code == 0
    assert result.stdout.startswith(words)
    assert json.loads(CliRunner().invoke(app, ['runs', '--json']).stdout)['recordings'] == []


def test_a_folder_that_is_not_there_is_refused() -> None:
    result = porotwin('runs', '/nowhere')
    assert result.returncode == 2
    assert '/nowhere: no such folder' in result.stderr


def test_what_is_odd_is_left_to_check(tmp_path: Path) -> None:
    shutil.copytree(SAMPLE.parents[1] / 'rigs' / 'small', tmp_path / 'run')
    file = tmp_path / 'run' / 'rig.yaml'
    file.write_text(re.sub(r'porosity: .*', 'porosity: 0.15', file.read_text()))
    told = porotwin('runs', tmp_path)
    assert '1 recording' in told.stdout
    assert '‡' not in told.stdout, 'a mark of bags'
    assert 'odd' not in told.stderr


def test_a_recording_of_the_virtual_rig_is_marked(tmp_path: Path) -> None:
    words = _columns(tmp_path)['rig']
    assert words(CatalogueEntry(tmp_path, 'folder', rig='tank', virtual=True)) == 'tank, virtual'
    assert words(CatalogueEntry(tmp_path, 'folder', rig='tank')) == 'tank'


@pytest.mark.parametrize(
    ('size_bytes', 'words'),
    [(0, '0 B'), (999, '999 B'), (999_499, '999 kB'), (999_999, '1 MB'), (1_234_567, '1.23 MB')],
)
def test_a_size_has_three_digits(size_bytes: int, words: str) -> None:
    assert size_words(size_bytes) == words


def test_a_sign_that_the_terminal_has_not_is_shown_by_its_number(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(experiment, tmp_path / 'run')
    monkeypatch.setenv('PYTHONIOENCODING', 'latin-1')
    result = porotwin_process('runs', tmp_path)
    assert result.returncode == 0, result.stderr
    assert r'\u2020 date of its files' in result.stdout
