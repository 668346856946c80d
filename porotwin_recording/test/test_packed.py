"""Archives of data are read as what they hold."""

import gzip
import zipfile
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.packed import opened_archive


def packed(path: Path, name: str, data: bytes) -> Path:
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr(name, data)
    return path


def test_a_file_that_is_no_archive_stays(tmp_path: Path) -> None:
    with opened_archive(tmp_path) as found:
        assert found == tmp_path


def test_a_file_in_a_folder_of_an_archive_in_an_archive_is_found(tmp_path: Path) -> None:
    inner = packed(tmp_path / 'inner.zip', 'run 1/maps.csv', b'time\n')
    outer = packed(tmp_path / 'outer.zip', 'backup/run.zip', inner.read_bytes())
    with opened_archive(outer) as found:
        assert found.name == 'maps.csv'
        assert found.read_bytes() == b'time\n'
        place = found
    assert not place.exists()


def test_a_zipped_zarr_gets_its_ending(tmp_path: Path) -> None:
    with opened_archive(packed(tmp_path / 'maps.zip', 'zarr.json', b'{}')) as found:
        assert found.suffix == '.zarr'
        assert (found / 'zarr.json').is_file()


def test_a_cut_archive_is_refused_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / 'maps.csv.gz'
    path.write_bytes(gzip.compress(b'time' * 1000)[:30])
    fault = r'maps\.csv\.gz: not readable as an archive'
    with pytest.raises(InputError, match=fault), opened_archive(path):
        pass
