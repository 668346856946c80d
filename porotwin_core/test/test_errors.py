"""Tests of the errors about files that cannot be written."""

import errno
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from porotwin_core.basis.errors import InputError, check_writable, refuse_file, write_error, writing


def test_a_place_where_one_may_not_write_is_wrong_input(tmp_path: Path) -> None:
    found = write_error(tmp_path / 'maps.nc', PermissionError(errno.EACCES, 'Permission denied'))
    assert isinstance(found, InputError)
    assert 'cannot be written (Permission denied); name an output where you may' in str(found)


def test_a_folder_below_a_file_and_a_long_name_are_wrong_input(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    for folder in (tmp_path / 'file', tmp_path / ('long' * 100)):
        with pytest.raises(InputError, match='name an output where you may'), writing(folder):
            folder.mkdir(parents=True, exist_ok=True)


@pytest.mark.parametrize(
    'error', [OSError(errno.ENOSPC, ''), OSError(errno.EACCES, ''), RuntimeError('HDF error')]
)
def test_a_full_disk_is_told_even_by_a_library_without_reasons(
    tmp_path: Path, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: SimpleNamespace(free=0))
    found = write_error(tmp_path / 'absent' / 'maps.nc', error)
    assert isinstance(found, OSError)
    assert 'no space left on its disk; remove something' in str(found)


def test_another_fault_keeps_its_reason(tmp_path: Path) -> None:
    found = write_error(tmp_path / 'maps.nc', RuntimeError('NetCDF: HDF error'))
    assert isinstance(found, OSError)
    assert 'cannot be written (NetCDF: HDF error); look at its disk' in str(found)


def test_a_writable_place_passes(tmp_path: Path) -> None:
    check_writable(tmp_path / 'maps.nc')
    (tmp_path / 'maps.nc').touch()
    check_writable(tmp_path / 'maps.nc')


def test_a_place_below_a_file_is_refused(tmp_path: Path) -> None:
    check_writable(tmp_path / 'new' / 'newer' / 'maps.nc')
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match=r'maps\.nc: cannot be written \(Not a directory\)'):
        check_writable(tmp_path / 'file' / 'new' / 'maps.nc')


def test_a_file_in_place_of_a_folder_is_refused(tmp_path: Path) -> None:
    refuse_file(tmp_path, 'reports')
    refuse_file(tmp_path / 'new', 'reports')
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match='file: is a file; name a folder for reports'):
        refuse_file(tmp_path / 'file', 'reports')


def test_a_folder_that_one_may_not_look_into_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def look(place: Path) -> bool:
        if tmp_path in place.parents:
            raise PermissionError(errno.EACCES, 'Permission denied')
        return True

    monkeypatch.setattr(Path, 'exists', look)
    monkeypatch.setattr(Path, 'is_dir', look)
    with pytest.raises(InputError, match=r'cannot be written \(Permission denied\); name an'):
        check_writable(tmp_path / 'closed' / 'maps.nc')


def test_a_name_that_is_too_long_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'cannot be written \(File name too long\)'):
        check_writable(tmp_path / ('x' * 300))


def test_the_nearest_existing_folder_must_be_writable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, 'access', lambda place, _: Path(place) != tmp_path)
    with pytest.raises(InputError, match='cannot be written'):
        check_writable(tmp_path / 'new' / 'newer')


def test_a_fault_while_writing_names_the_output(tmp_path: Path) -> None:
    target = tmp_path / 'picture.png'
    with pytest.raises(OSError, match=r'picture\.png: no space left on its disk'), writing(target):
        raise OSError(errno.ENOSPC, 'No space left on device')
    with writing(target):
        target.touch()
