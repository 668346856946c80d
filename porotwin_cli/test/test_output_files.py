"""Output files that would replace an input are refused."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from porotwin_cli.options.output_files import (
    check_output,
    maker,
    maps_are_kept,
    one_call_for_each_output,
)
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    folder = tmp_path / 'monday'
    (folder / 'photos').mkdir(parents=True)
    for name in ('rig.yaml', 'photos/photo_000.jpg'):
        (folder / name).write_text('input')
    return folder


@pytest.mark.parametrize('name', ['rig.yaml', 'photos/photo_000.jpg', 'photos/../rig.yaml'])
def test_a_file_of_the_input_is_kept(recording: Path, name: str) -> None:
    with pytest.raises(InputError, match='is a file of the input'):
        check_output(recording / name, recording)


def test_an_input_is_kept_under_every_name(recording: Path, tmp_path: Path) -> None:
    link = tmp_path / 'link.yaml'
    link.symlink_to(recording / 'rig.yaml')
    with pytest.raises(InputError, match='is an input'):
        check_output(link, None, recording / 'rig.yaml')
    with pytest.raises(InputError, match='is a file of the input'):
        check_output(link, recording)


def test_new_files_and_files_elsewhere_are_written(recording: Path, tmp_path: Path) -> None:
    check_output(recording / 'maps.nc', recording)
    (tmp_path / 'maps.nc').write_text('older maps')
    check_output(tmp_path / 'maps.nc', recording, recording / 'rig.yaml')


def test_a_command_may_overwrite_what_it_made(recording: Path) -> None:
    maps, picture = recording / 'model.nc', recording / 'check.png'
    for kept in (maps, recording / 'concentration.nc'):
        with ConcentrationWriter(kept, Grid(3, 2, 0.3, 0.2), origin=made('simulate')) as writer:
            writer.append(0.0, np.zeros((2, 3)))
    plain = PngInfo()
    plain.add_text('Software', maker('check'))
    Image.new('L', (2, 2)).save(picture, pnginfo=plain)
    Image.new('L', (2, 2)).save(recording / 'photo.png')
    check_output(maps, recording, command='simulate')
    check_output(picture, recording, command='check')
    for file, command in (
        (maps, 'image'),
        (maps, ''),
        (picture, 'simulate'),
        (recording / 'photo.png', 'check'),
        (recording / 'concentration.nc', 'simulate'),
        (recording / 'rig.yaml', 'check'),
    ):
        with pytest.raises(InputError, match='is a file of the input'):
            check_output(file, recording, command=command)


@pytest.mark.parametrize(
    ('description', 'file'),
    [
        ('sand_image: {file: sands.png}', 'sands.png'),
        ('control: {zone: {file: ../rig/./zone.nc}}', 'zone.nc'),
        ('depth_m: {points_file: points.csv}\nwidth_m: wrong', 'points.csv'),
    ],
)
def test_a_file_that_a_description_names_is_kept(tmp_path: Path, description, file) -> None:
    folder = tmp_path / 'rig'
    folder.mkdir()
    (folder / 'rig.yaml').write_text(description)
    for name in (file, 'other.png'):
        (folder / name).write_text('of the lab')
    with pytest.raises(InputError, match='is a file of the input'):
        check_output(folder / file, folder / 'rig.yaml', command='check')
    check_output(folder / 'other.png', folder / 'rig.yaml', command='check')


def test_a_file_that_nobody_named_is_kept_unless_the_command_made_it(tmp_path: Path) -> None:
    picture, table = tmp_path / 'maps.png', tmp_path / 'maps.csv'
    for file in (picture, table):
        check_output(file, command='segment', named=False)
        file.write_text('of the lab')
        with pytest.raises(InputError, match='exists already, and segment did not make it'):
            check_output(file, command='segment', named=False)
        check_output(file, command='segment')
    with ConcentrationWriter(
        tmp_path / 'maps.nc', Grid(3, 2, 0.3, 0.2), origin=made('segment')
    ) as writer:
        writer.append(0.0, np.zeros((2, 3)))
    check_output(table, command='segment', named=False)


def made(command: str) -> MapOrigin:
    return MapOrigin(program=maker(command))


def test_a_missing_folder_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='absent; make it'):
        check_output(tmp_path / 'absent' / 'maps.nc')
    with pytest.raises(InputError, match='is a folder'):
        check_output(tmp_path)
    link = tmp_path / 'link.nc'
    link.symlink_to(tmp_path / 'disk_that_is_not_there.nc')
    with pytest.raises(InputError, match='is a link to nothing'):
        check_output(link)


def test_a_second_call_for_an_output_is_refused(tmp_path: Path) -> None:
    output = tmp_path / 'maps.nc'

    @one_call_for_each_output
    def command(experiment: Path, output: Path, inner: bool = True) -> None:
        if inner:
            command(experiment, output=output, inner=False)

    with pytest.raises(InputError, match=r'maps\.nc: is being written by another call; wait'):
        command(tmp_path, output)
    command(tmp_path, output, inner=False)
    command(tmp_path, tmp_path / 'absent' / 'maps.nc', inner=False)
    assert not list(tmp_path.iterdir())


def test_a_picture_that_fails_tells_of_the_maps() -> None:
    told = pytest.raises(OSError, match=r'disk; the maps are complete in s\.nc')
    with told, maps_are_kept(Path('s.nc')):
        raise OSError('no space left on its disk')
