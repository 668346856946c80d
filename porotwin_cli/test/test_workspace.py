"""Places on disk."""

import datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from porotwin_cli import workspace
from porotwin_cli.workspace import run_folder, small_rig
from porotwin_core.basis.errors import InputError


def test_the_small_rig_is_there() -> None:
    assert small_rig().is_file()


def test_a_run_gets_a_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_folder(None, 'demo').parent == tmp_path / 'runs'
    assert run_folder(tmp_path / 'mine', 'demo') == tmp_path / 'mine'
    assert run_folder(tmp_path / 'mine', 'demo').is_dir()


def test_two_runs_of_the_same_second_get_two_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(workspace, 'datetime', SimpleNamespace(datetime=_StandingClock))
    first, second, third = (run_folder(None, 'up') for _ in range(3))
    assert first.name == 'up-20261128-120000'
    assert [second.name, third.name] == [f'{first.name}-2', f'{first.name}-3']


class _StandingClock:
    @staticmethod
    def now() -> datetime.datetime:
        return datetime.datetime(2026, 11, 28, 12).astimezone()


def test_a_folder_with_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('precious')
    with pytest.raises(InputError, match='exists already; name another --output or remove it'):
        run_folder(tmp_path, 'demo')


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('precious')
    with pytest.raises(InputError, match='name another --output'):
        run_folder(tmp_path / 'file' / 'mine', 'demo')
