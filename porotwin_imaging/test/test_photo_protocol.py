"""The protocol `imaging.csv`: it may grow, and its faults are reported."""

from pathlib import Path

import pytest

from porotwin_core.basis import csv_table
from porotwin_imaging.sources.photo_protocol import GrowingProtocol

HEADER = 'time_s,path,role\n'


@pytest.fixture
def protocol(tmp_path) -> Path:
    return tmp_path / 'imaging.csv'


@pytest.mark.parametrize(
    ('content', 'roles'),
    [
        (HEADER + '0,x.jpg,baseline\n,,\n30, a.jpg, state \n', ['baseline', 'state']),
        ('time_s,path,role,concentration\n0,x.jpg,dilution,0.5\n', ['dilution']),
        ('path,time_s,role\nx.jpg,0,baseline\n', None),
        (HEADER + '1_0,x.jpg,state\n', None),
        (HEADER + '1,x.jpg,picture\n', None),
    ],
)
def test_the_list_is_that_of_a_recording(protocol, content: str, roles) -> None:
    protocol.write_text(content)
    for name in ('x.jpg', 'a.jpg'):
        (protocol.parent / name).touch()
    growing = GrowingProtocol(protocol.parent)
    changed, problems = growing.refresh()
    assert changed == (roles is not None) == (not problems)
    assert [line.role for line in growing.entries.values()] == (roles or [])


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


def test_a_protocol_that_cannot_be_read_for_a_moment_is_read_later(protocol, monkeypatch) -> None:
    def failing(*_: object) -> None:
        raise OSError('Input/output error')

    protocol.write_text(HEADER + '0,x.jpg,baseline\n')
    growing = GrowingProtocol(protocol.parent)
    with monkeypatch.context() as patched:
        patched.setattr(csv_table, 'open_text', failing)
        assert not growing.refresh()[0]
    assert growing.refresh() == (True, [])
