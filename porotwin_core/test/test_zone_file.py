"""The zone of the objective from a picture or a map."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig, load_rig, write_rig
from porotwin_core.rig.control_zones import control_zones, unwanted_tracer
from porotwin_core.rig.property_file import write_map
from porotwin_core.rig.zone_file import read_zone
from porotwin_core.ros import conversions

WIDTH, HEIGHT = 0.9, 0.6
TEXT = """
name: unit
width_m: 0.9
height_m: 0.6
depth_m: 0.01
porosity: 0.4
permeability_m2: 1.0e-9
viscosity_pa_s: 1.0e-3
density_kg_m3: 998.0
wells: {push: {x_m: 0.5, z_m: 0.3}}
control:
  wells: [push]
  zone: {file: zone.png}
"""
TOP_LEFT = np.array([[0.1, 0.5]])
TOP_RIGHT = np.array([[0.8, 0.5]])


def painted(folder: Path, pixels: np.ndarray, name: str = 'zone.png') -> Path:
    Image.fromarray(pixels.astype(np.uint8)).save(folder / name)
    return folder / name


def top_left_corner(rows: int = 60, columns: int = 90) -> np.ndarray:
    """Return a picture, its first row on top, whose upper left third is white."""
    pixels = np.zeros((rows, columns))
    pixels[: rows // 3, : columns // 3] = 255
    return pixels


@pytest.fixture
def rig(tmp_path: Path) -> Rig:
    painted(tmp_path, top_left_corner())
    (tmp_path / 'rig.yaml').write_text(TEXT)
    return load_rig(tmp_path)


def test_white_on_black_is_the_zone_seen_from_the_front(rig: Rig) -> None:
    ((kind, zone),) = control_zones(rig)
    assert kind == 'keep out'
    assert zone.contains(TOP_LEFT)[0]
    assert not zone.contains(TOP_RIGHT)[0]
    assert unwanted_tracer(rig, TOP_LEFT).tolist() == [True]


def test_transparent_pixels_are_not_in_the_zone(tmp_path: Path) -> None:
    pixels = np.full((60, 90, 4), 255)
    pixels[:, 30:, 3] = 0
    zone = read_zone(painted(tmp_path, pixels), 'zone', WIDTH, HEIGHT)
    assert zone.contains(TOP_LEFT)[0]
    assert not zone.contains(TOP_RIGHT)[0]


def test_a_map_holds_the_share_of_each_cell(tmp_path: Path) -> None:
    shares = np.zeros((6, 9))
    shares[4:, :3] = 0.8
    write_map(tmp_path / 'zone.nc', 'zone', shares, Grid(9, 6, WIDTH, HEIGHT))
    zone = read_zone(tmp_path / 'zone.nc', 'zone', WIDTH, HEIGHT)
    np.testing.assert_allclose(zone.shares, shares, rtol=1e-6)
    assert zone.contains(TOP_LEFT)[0]


def test_a_rig_with_a_picture_survives_a_message_and_a_file(rig: Rig, tmp_path: Path) -> None:
    received = conversions.rig_from_msg(conversions.rig_to_msg(rig))
    np.testing.assert_array_equal(received.zone.shares, rig.zone.shares)
    folder = tmp_path / 'copy'
    folder.mkdir()
    write_rig(received, folder / 'rig.yaml')
    assert load_rig(folder) == received


@pytest.mark.parametrize(
    ('pixels', 'message'),
    [
        (np.zeros((60, 90)), 'shows no zone'),
        (np.full((1, 1), 255), 'such as 500 x '),
        (np.full((60, 90), 255), 'at least half bright everywhere'),
        (top_left_corner(90, 60), '60 x 90 pixels do not have the shape of the rig'),
    ],
)
def test_a_wrong_picture_is_refused_in_one_line(pixels, message, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_zone(painted(tmp_path, pixels), 'zone', WIDTH, HEIGHT)
    assert '\n' not in str(caught.value)


def test_a_picture_of_too_many_pixels_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('PIL.Image.MAX_IMAGE_PIXELS', 1000)  # Pillow refuses twice as many
    with pytest.raises(InputError, match='save it smaller'):
        read_zone(painted(tmp_path, top_left_corner(90, 60)), 'zone', WIDTH, HEIGHT)


def test_a_file_that_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'zone.png').write_text('no picture')
    with pytest.raises(InputError, match='not a readable picture'):
        read_zone(tmp_path / 'zone.png', 'zone', WIDTH, HEIGHT)
    with pytest.raises(InputError, match='no such file'):
        read_zone(tmp_path / 'other.png', 'zone', WIDTH, HEIGHT)


def test_a_map_beside_the_rig_is_refused(tmp_path: Path) -> None:
    write_map(tmp_path / 'zone.nc', 'zone', np.eye(6, 9), Grid(9, 6, 1000 * WIDTH, 1000 * HEIGHT))
    with pytest.raises(InputError, match='the map must cover the whole rig'):
        read_zone(tmp_path / 'zone.nc', 'zone', WIDTH, HEIGHT)


def test_a_map_in_percent_is_refused(tmp_path: Path) -> None:
    write_map(tmp_path / 'zone.nc', 'zone', 100.0 * np.eye(6, 9), Grid(9, 6, WIDTH, HEIGHT))
    with pytest.raises(InputError, match='reaches 100; it must be a share'):
        read_zone(tmp_path / 'zone.nc', 'zone', WIDTH, HEIGHT)


def test_corners_and_a_picture_are_one_too_many(tmp_path: Path) -> None:
    painted(tmp_path, top_left_corner())
    corners = '  disallowed_zone_m: [[0.1, 0.1], [0.2, 0.1], [0.2, 0.2]]\n'
    (tmp_path / 'rig.yaml').write_text(TEXT + corners)
    with pytest.raises(InputError, match='zone and disallowed_zone_m both'):
        load_rig(tmp_path)


def test_a_file_in_place_of_corners_is_told_where_it_belongs(tmp_path: Path) -> None:
    text = TEXT.replace('zone: {', 'disallowed_zone_m: {')
    (tmp_path / 'rig.yaml').write_text(text)
    with pytest.raises(InputError, match=r'a picture is named by control\.zone'):
        load_rig(tmp_path)
