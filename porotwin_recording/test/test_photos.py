"""Tests of imaging.csv: faults of a table are named, and no photograph leaves its folder."""

from pathlib import Path

import pytest
from recording_examples import two_photos

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.photos import Photo, read_photos, write_photos


@pytest.mark.parametrize(
    ('content', 'complaint'),
    [
        ('time,path,role\n', 'write time_s,path,role'),
        ('time_s,path,role\n0,photos/first.jpg,dark\n', ":2: role is 'dark'; write baseline or"),
        ('time_s,path,role\n0,photos/gone.jpg,state\n', "'photos/gone.jpg' is not there"),
        ('time_s,path,role\n0,photos/First.JPG,state\n', "did you mean 'first.jpg'"),
        ('time_s,path,role\n0,photos\\\\gone.jpg,state\n', 'with / between folders'),
        ('time_s,path,role\n0,../first.jpg,state\n', 'leaves the folder'),
        ('time_s,path,role\n,photos/first.jpg,state\n', "time_s is ''"),
        ('time_s,path,role\n1.7e9,photos/first.jpg,state\n', 'more than a year from the start'),
        ('time_s,path,role\n0,photos/first.jpg,dilution\n', "concentration is ''"),
        ('time_s,path,role,concentration\n0,photos/first.jpg,dilution,7\n', 'share of stock'),
        ('time_s,path,role,concentration\n0,photos/first.jpg,state,1\n', 'leave it empty'),
    ],
)
def test_wrong_imaging_tables_are_named(tmp_path: Path, content: str, complaint: str) -> None:
    write_photos(tmp_path, two_photos())
    (tmp_path / 'imaging.csv').write_text(content)
    with pytest.raises(InputError, match=complaint):
        read_photos(tmp_path)


@pytest.mark.parametrize(
    ('names', 'complaint'),
    [
        (('a.jpg', 'a.jpg'), "two photographs are named 'a.jpg'"),
        (('../a.jpg',), "'../a.jpg' would leave the folder"),
        (('/tmp/a.jpg',), 'would leave the folder'),
    ],
)
def test_wrong_names_are_refused(tmp_path: Path, names: tuple[str, ...], complaint: str) -> None:
    photos = [Photo(0.0, 'state', name, lambda: b'') for name in names]
    with pytest.raises(InputError, match=complaint):
        write_photos(tmp_path, photos)


def test_a_dilution_keeps_its_concentration(tmp_path: Path) -> None:
    known = Photo(60.0, 'dilution', 'half.jpg', lambda: b'half', concentration=0.5)
    write_photos(tmp_path, [*two_photos(), known])
    read = read_photos(tmp_path)
    assert [photo.concentration for photo in read if photo.role == 'dilution'] == [0.5]
    assert all(photo.concentration is None for photo in read if photo.role != 'dilution')


def test_a_photograph_behind_a_link_lies_in_the_folder(tmp_path: Path) -> None:
    folder, secret = tmp_path / 'experiment', tmp_path / 'secret.jpg'
    secret.write_bytes(b'of somebody else')
    write_photos(folder, two_photos())
    first = folder / 'photos' / 'first.jpg'
    inside = first.rename(folder / 'photos' / 'original.jpg')
    first.symlink_to(inside.name)
    assert read_photos(folder)[0].read() == inside.read_bytes()
    first.unlink()
    first.symlink_to('../../secret.jpg')
    with pytest.raises(InputError, match=r"'photos/first\.jpg' is a link that leads out"):
        read_photos(folder)
    first.unlink()
    (folder / 'photos').rename(tmp_path / 'elsewhere')
    inside = (tmp_path / 'elsewhere' / 'original.jpg').rename(tmp_path / 'elsewhere' / 'first.jpg')
    (folder / 'photos').symlink_to(tmp_path / 'elsewhere')
    with pytest.raises(InputError, match='leads out'):
        read_photos(folder)
