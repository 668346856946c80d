"""Folders that are written completely or not at all."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.whole_folder import whole_folder


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def killed(path: Path, source: str = '') -> None:
    """Write a file for the folder `path` in a process that is killed before the end."""
    program = (
        'import os, signal, sys; from pathlib import Path\n'
        'from porotwin_core.basis.whole_folder import whole_folder\n'
        'with whole_folder(Path(sys.argv[1]), source=sys.argv[2]) as unfinished:\n'
        "    (unfinished / 'first').touch()\n"
        '    os.kill(os.getpid(), signal.SIGKILL)\n'
    )
    call = subprocess.run([sys.executable, '-c', program, path, source], env=os.environ)
    assert call.returncode == -signal.SIGKILL


def test_a_folder_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / 'runs' / 'monday'
    with whole_folder(path) as unfinished:
        (unfinished / 'first').touch()
        assert not path.exists()
    assert names(path) == ['first']
    assert names(path.parent) == ['monday']


@pytest.mark.parametrize('error', [InputError, KeyboardInterrupt])
def test_an_error_or_an_interrupt_leaves_nothing(tmp_path: Path, error: type) -> None:
    with pytest.raises(error), whole_folder(tmp_path / 'monday') as unfinished:
        (unfinished / 'first').touch()
        raise error
    assert names(tmp_path) == []


def test_the_rest_of_a_killed_call_is_no_part_of_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / 'monday'
    killed(path)
    assert names(tmp_path) == ['.monday.partial']
    with whole_folder(path) as unfinished:
        (unfinished / 'second').touch()
    assert names(path) == ['second']
    assert names(tmp_path) == ['monday']


@pytest.mark.parametrize(('source', 'found'), [('a bag', ['first']), ('another bag', [])])
def test_a_killed_call_goes_on_if_its_source_is_the_same(
    tmp_path: Path, source: str, found: list[str]
) -> None:
    path = tmp_path / 'monday'
    killed(path, source='a bag')
    with whole_folder(path, source=source) as unfinished:
        assert names(unfinished) == found
        (unfinished / 'second').touch()
    assert names(path) == [*found, 'second']
    assert names(tmp_path) == ['monday']


def test_only_an_interrupt_leaves_what_has_a_source(tmp_path: Path) -> None:
    path = tmp_path / 'monday'
    with pytest.raises(KeyboardInterrupt), whole_folder(path, source='a bag') as unfinished:
        (unfinished / 'first').touch()
        raise KeyboardInterrupt
    assert names(tmp_path / '.monday.partial') == ['first']
    with pytest.raises(InputError), whole_folder(path, source='a bag') as unfinished:
        assert names(unfinished) == ['first']
        raise InputError
    assert names(tmp_path) == []


def test_what_another_call_began_is_not_taken_for_that_of_a_source(tmp_path: Path) -> None:
    path = tmp_path / 'monday'
    killed(path, source='a bag')
    killed(path)
    with whole_folder(path, source='a bag') as unfinished:
        assert names(unfinished) == []


@pytest.mark.parametrize('is_file', [True, False])
def test_a_writer_may_name_its_files_after_the_folder(tmp_path: Path, is_file: bool) -> None:
    path = tmp_path / 'monday.mcap'
    with whole_folder(path, named=True) as unfinished:
        assert unfinished.name == path.name
        if is_file:
            unfinished.touch()
        else:
            unfinished.mkdir()
    assert path.is_file() is is_file
    assert names(tmp_path) == ['monday.mcap']


@pytest.mark.parametrize('named', [True, False])
def test_a_folder_that_has_come_meanwhile_is_not_changed(tmp_path: Path, named: bool) -> None:
    path = tmp_path / 'monday'
    with (
        pytest.raises(InputError, match='monday: exists already'),
        whole_folder(path, named=named) as unfinished,
    ):
        unfinished.mkdir(exist_ok=True)
        (unfinished / 'first').touch()
        path.mkdir()
    assert names(path) == []
    assert names(tmp_path) == ['monday']


def test_files_of_a_folder_that_may_exist_are_replaced(tmp_path: Path) -> None:
    path = tmp_path / 'monday'
    path.mkdir()
    for name in ('first', 'own'):
        (path / name).write_text('old')
    with whole_folder(path, replaces=True) as unfinished:
        (unfinished / 'first').write_text('new')
        assert (path / 'first').read_text() == 'old'
    assert names(path) == ['first', 'own']
    assert (path / 'first').read_text() == 'new'
    assert names(tmp_path) == ['monday']
