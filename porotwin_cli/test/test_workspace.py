"""Places on disk."""

from pathlib import Path

import pytest

from porotwin_cli.workspace import run_folder, small_rig
from porotwin_core.errors import InputError


def test_the_small_rig_is_there() -> None:
    assert small_rig().is_file()


def test_a_run_gets_a_new_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_folder(None, 'demo').parent == tmp_path / 'runs'
    assert run_folder(tmp_path / 'mine', 'demo') == tmp_path / 'mine'
    assert run_folder(tmp_path / 'mine', 'demo').is_dir()


def test_a_folder_with_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('precious')
    with pytest.raises(InputError, match='exists already; name another --output or remove it'):
        run_folder(tmp_path, 'demo')


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('precious')
    with pytest.raises(InputError, match='name another --output'):
        run_folder(tmp_path / 'file' / 'mine', 'demo')
