"""Archives of data are read as what they hold."""

import bz2
import gzip
import io
import lzma
import tarfile
import zipfile
from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.importers.map_import import maps_in
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


def tarred(path: Path, name: str, data: bytes = b'', **facts: object) -> Path:
    member = tarfile.TarInfo(name)
    member.size = len(data)
    for fact, value in facts.items():
        setattr(member, fact, value)
    with tarfile.open(path, 'w') as archive:
        archive.addfile(member, io.BytesIO(data))
    return path


def test_a_tar_that_ends_with_a_zip_is_a_tar(tmp_path: Path) -> None:
    inner = packed(tmp_path / 'maps.npz', 'maps.npy', b'numbers').read_bytes()
    with opened_archive(tarred(tmp_path / 'maps.tar', 'maps.npz', inner)) as found:
        assert found.name == 'maps.npz'
        assert found.read_bytes() == inner


def test_damaged_names_links_times_and_parts_are_refused(tmp_path: Path) -> None:
    zipped = packed(tmp_path / 'name.zip', 'm\xe4ps.csv', b'time')
    zipped.write_bytes(zipped.read_bytes().replace('\xe4'.encode(), b'\xff\xfe'))
    part = tmp_path / 'part.zip'
    with zipfile.ZipFile(part, 'w', zipfile.ZIP_LZMA) as archive:
        archive.writestr('maps.csv', bytes(range(256)) * 9)
    data = bytearray(part.read_bytes())
    data[80:140] = b'\xff' * 60
    part.write_bytes(data)
    link = tarred(tmp_path / 'link.tar', 'maps.csv', type=tarfile.LNKTYPE, linkname='none')
    late = tarred(tmp_path / 'late.tar', 'maps.csv', mtime=float(1 << 70))
    for path in (zipped, part, link, late):
        fault = f'{path.name}: not readable as an archive'
        with pytest.raises(InputError, match=fault), opened_archive(path):
            pass


@pytest.mark.parametrize('pack', [gzip.compress, bz2.compress, lzma.compress])
def test_a_packed_file_is_known_by_its_first_bytes(tmp_path: Path, pack) -> None:
    path = tmp_path / 'maps.csv'
    path.write_bytes(pack(b'time'))
    with opened_archive(path) as found:
        assert (found.name, found.read_bytes()) == ('maps.csv', b'time')


def test_a_file_that_is_not_read_is_told_with_its_remedy(tmp_path: Path) -> None:
    locked = packed(tmp_path / 'locked.zip', 'maps.csv', b'time')
    data = bytearray(locked.read_bytes())
    for sign, bits in ((b'PK\x03\x04', 6), (b'PK\x01\x02', 8)):
        data[data.find(sign) + bits] |= 1
    sheet = packed(tmp_path / 'sheet.xlsx', '[Content_Types].xml', b'')
    files = {
        'password': bytes(data),
        'spreadsheet': sheet.read_bytes(),
        '7z x': b"7z\xbc\xaf'\x1c\0",
        'unrar': b'Rar!\x1a\x07',
        'git lfs pull': b'version https://git-lfs.github.com/spec/v1',
        'web page': b'<!DOCTYPE html>',
        'is empty': b'',
    }
    for remedy, content in files.items():
        path = tmp_path / 'maps.nc'
        path.write_bytes(content)
        with pytest.raises(InputError, match=remedy), opened_archive(path):
            pass


def test_the_only_file_of_maps_is_found_beside_its_rig(tmp_path: Path) -> None:
    names = ('run/rig.yaml', 'run/zone.nc', 'run/raw/maps.npz', '__MACOSX/run/._maps.npz')
    path = tmp_path / 'run.zip'
    with zipfile.ZipFile(path, 'w') as archive:
        for name in names:
            archive.writestr(name, 'control: {zone: {file: zone.nc}}')
    with opened_archive(path) as found:
        assert maps_in(found).name == 'maps.npz'
    with zipfile.ZipFile(path, 'a') as archive:
        archive.writestr('run/raw/other.npz', '')
    with (
        pytest.raises(InputError, match=r'run\.zip/run: holds 2 files of maps'),
        opened_archive(path) as found,
    ):
        maps_in(found)
    experiment = tmp_path / 'experiment'
    experiment.mkdir()
    for name in ('rates.csv', 'maps.npz'):
        (experiment / name).write_text('')
    assert maps_in(experiment) == experiment
