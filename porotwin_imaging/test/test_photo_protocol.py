"""The protocol `imaging.csv`: it may grow, and its faults are reported."""

import errno
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.sources import photo_protocol
from porotwin_imaging.sources.photo_protocol import GrowingProtocol, read_protocol

HEADER = 'time_s,path,role\n'


@pytest.fixture
def protocol(tmp_path) -> Path:
    return tmp_path / 'imaging.csv'


def test_entries_have_times_and_roles(protocol) -> None:
    protocol.write_text(HEADER + '0,photos/x.jpg,baseline\n30, photos/a.jpg, state\n')
    folder = protocol.parent / 'photos'
    assert read_protocol(protocol) == {
        folder / 'x.jpg': (0.0, 'baseline'),
        folder / 'a.jpg': (30.0, 'state'),
    }


@pytest.mark.parametrize('line', ['soon,a.jpg,state', 'nan,a.jpg,state', '1,a.jpg,picture', '1'])
def test_a_wrong_line_is_refused(protocol, line: str) -> None:
    protocol.write_text(HEADER + line)
    with pytest.raises(InputError, match='write time_s,path,role with a finite number'):
        read_protocol(protocol)


def test_a_file_that_is_no_utf8_is_refused(protocol) -> None:
    protocol.write_bytes((HEADER + '0,größe.jpg,baseline\n').encode('cp1252'))
    with pytest.raises(InputError, match='save it as CSV in UTF-8'):
        read_protocol(protocol)


def test_a_protocol_may_come_late_and_grow_and_each_fault_is_reported_once(tmp_path) -> None:
    growing = GrowingProtocol(tmp_path / 'photos')
    assert growing.refresh() == (False, [])
    protocol = tmp_path / 'imaging.csv'  # the parent of the folder is searched as well
    protocol.write_text(HEADER + '0,photos/x.jpg,baseline\n')
    assert growing.refresh() == (True, [])
    assert growing.refresh() == (False, [])
    protocol.write_text(protocol.read_text() + 'soon,photos/y.jpg,state\n')
    changed, (problem,) = growing.refresh()
    assert not changed
    assert problem.code == 'wrong_protocol'
    assert growing.refresh() == (False, [])
    assert list(growing.entries) == [tmp_path / 'photos' / 'x.jpg']


def test_a_protocol_that_cannot_be_read_for_a_moment_is_told_once_and_read_later(
    protocol, monkeypatch
) -> None:
    def failing(_: Path) -> None:
        raise OSError(errno.EIO, 'Input/output error')

    protocol.write_text(HEADER + '0,x.jpg,baseline\n')
    growing = GrowingProtocol(protocol.parent)
    with monkeypatch.context() as patched:
        patched.setattr(photo_protocol, 'read_protocol', failing)
        changed, (problem,) = growing.refresh()
        assert not changed
        assert problem.code == 'unreadable'
        assert growing.refresh() == (False, [])
    assert growing.refresh() == (True, [])
    assert list(growing.entries) == [protocol.parent / 'x.jpg']
