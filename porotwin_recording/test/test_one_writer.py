"""Tests that an output has one writer."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.one_writer import one_writer, only_writer


def test_a_second_writer_of_an_output_is_refused(tmp_path: Path) -> None:
    target = tmp_path / 'new' / 'experiment'
    with one_writer(target):
        with (
            pytest.raises(InputError, match='is being written by another call'),
            one_writer(target),
        ):
            pass
        with one_writer(tmp_path / 'new' / 'other'):
            pass
    with one_writer(target):
        target.mkdir()
    assert list(target.parent.iterdir()) == [target]
    with pytest.raises(InputError, match='exists already'), one_writer(target):
        pass


def test_a_file_that_exists_has_one_writer_too(tmp_path: Path) -> None:
    target = tmp_path / 'maps.nc'
    target.touch()
    (tmp_path / '.maps.nc.writer').touch()  # a killed call left it
    link = tmp_path / 'link.nc'
    link.symlink_to(target)
    with (
        only_writer(target),
        pytest.raises(InputError, match='is being written by another call'),
        only_writer(link),
    ):
        pass
    assert sorted(tmp_path.iterdir()) == [link, target]


def test_the_root_is_no_output() -> None:
    with pytest.raises(InputError, match='name a folder for this output'), only_writer(Path('/')):
        pass


def test_a_place_that_holds_no_files_is_no_second_writer() -> None:
    with pytest.raises(InputError, match='cannot be written'), only_writer(Path('/proc/maps.nc')):
        pass
