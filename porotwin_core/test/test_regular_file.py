"""Tests of the one way to open a file that a person names."""

import ast
import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular, open_text, read_regular, regular

ROOT = Path(__file__).resolve().parents[2]

OWN_FILES = {
    'porotwin_cli/porotwin_cli/memory_limit.py': 'of the kernel',
    'porotwin_core/porotwin_core/basis/parallel.py': 'of the kernel',
    'porotwin_page/porotwin_page/rigs.py': 'of the kernel',
    'porotwin_imaging/porotwin_imaging/photograph/sent_photos.py': 'written by the camera node',
    'porotwin_imaging/porotwin_imaging/sources/gphoto2.py': 'in a new temporary folder',
    'porotwin_cli/porotwin_cli/commands/test.py': 'of the source code',
    'porotwin_hub/porotwin_hub/launching/parameter_file.py': 'of the package',
    'porotwin_page/porotwin_page/web_files.py': 'of the package',
    'porotwin_recording/porotwin_recording/mcap/definitions.py': 'of installed packages',
    'porotwin_hub/porotwin_hub/launching/processes.py': 'logs of this run',
    'porotwin_cli/porotwin_cli/commands/diagnose.py': 'written a moment before',
    'porotwin_core/porotwin_core/basis/whole_folder.py': 'in an unfinished output',
    'porotwin_diagnosis/porotwin_diagnosis/report/report_folder.py': 'in an unfinished output',
    'porotwin_recording/porotwin_recording/importers/packed.py': 'after a look at its kind',
    'porotwin_recording/porotwin_recording/tables/map_parts.py': 'in an unfinished output',
    'porotwin_recording/porotwin_recording/experiment/dataset_export.py': 'in an unfinished output',
    'porotwin_diagnosis/porotwin_diagnosis/archive.py': 'in the folder of a bench',
    'porotwin_rig/porotwin_rig/mock_camera_node.py': 'named by the table of photographs',
}
"""Files of the product that read by themselves, and the files that they read."""


def reads(call: ast.Call) -> bool:
    """Return whether a call reads a file without a look at its kind."""
    if not isinstance(call.func, ast.Attribute):
        return isinstance(call.func, ast.Name) and call.func.id == 'open'
    if call.func.attr in ('read_text', 'read_bytes'):
        return True
    mode = [word.value for word in call.args if isinstance(word, ast.Constant)]
    named = ast.unparse(call.func.value).lower()
    path = any(word in named for word in ('path', 'file', 'log'))
    return (
        call.func.attr == 'open' and path and not set(mode) & {'w', 'wb', 'a', 'ab', 'x+b', 'w+b'}
    )


def test_no_other_reader_opens_a_file_that_a_person_names() -> None:
    found = {
        str(path.relative_to(ROOT))
        for path in ROOT.glob('porotwin_*/porotwin_*/**/*.py')
        for call in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
        if isinstance(call, ast.Call) and reads(call)
    }
    assert found == set(OWN_FILES)


@pytest.fixture(params=['FIFO', 'socket', 'device', 'link to a FIFO'])
def odd(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return something that is no regular file."""
    path = tmp_path / 'odd'
    if request.param == 'FIFO':
        os.mkfifo(path)
    elif request.param == 'socket':
        monkeypatch.chdir(tmp_path)  # the path of a socket must be short
        socket.socket(socket.AF_UNIX).bind('odd')
    elif request.param == 'device':
        path.symlink_to('/dev/zero')
    else:
        os.mkfifo(tmp_path / 'fifo')
        path.symlink_to(tmp_path / 'fifo')
    return path


@pytest.mark.parametrize(
    'read', [regular, open_regular, read_regular, lambda path: open_text(path, 'utf-8')]
)
def test_what_is_no_regular_file_is_refused_at_once(
    odd: Path, read: Callable[[Path], object]
) -> None:
    with pytest.raises(InputError) as refused:
        read(odd)
    assert str(refused.value) == f'{odd}: is a FIFO, socket or device; name a file'


def test_a_fifo_that_takes_the_place_of_a_file_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.mkfifo(tmp_path / 'fifo')
    monkeypatch.setattr('porotwin_core.basis.regular_file.regular', lambda path: path)
    with pytest.raises(InputError, match='is a FIFO'):
        open_regular(tmp_path / 'fifo')


def test_regular_files_are_read_and_folders_and_too_large_files_are_not(tmp_path: Path) -> None:
    path = tmp_path / 'rates.csv'
    path.write_text('\ufeffa,b\r\n')
    assert read_regular(path)[-5:] == b'a,b\r\n'
    assert read_regular(path, 3) == b'\xef\xbb\xbf'
    with open_text(path, 'utf-8-sig') as file:
        assert file.read() == 'a,b\r\n'
    with pytest.raises(IsADirectoryError):
        open_regular(tmp_path)
    with pytest.raises(FileNotFoundError):
        regular(tmp_path / 'nothing')
    os.truncate(path, 1 << 40)
    with pytest.raises(InputError, match=r'rates\.csv: claims 1.1e\+12 bytes'):
        read_regular(path)
