"""Tests of the origin of a diagnosis."""

from pathlib import Path

from porotwin_diagnosis.report.origin import place_of


def test_a_recording_has_one_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / 'mon'
    folder.mkdir()
    paths = ('mon', './mon/', folder, folder / 'rig.yaml')
    assert {place_of(Path(path)) for path in paths} == {folder.resolve()}
