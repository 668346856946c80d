"""./porotwin measure: a moving plume in a file of maps."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from cli_examples import porotwin
from typer.testing import CliRunner

from porotwin_cli.app import app
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig
from porotwin_recording.tables.concentration import ConcentrationWriter, MapOrigin, open_maps


@pytest.fixture
def moving(tmp_path: Path) -> Path:
    """Maps of a round plume that moves by 0.1 m, the second with a deviation."""
    rig = load_rig(small_rig())
    grid = rig.grid(94, 56)
    x, z = np.meshgrid(grid.x, grid.z)
    path = tmp_path / 'maps.nc'
    with ConcentrationWriter(path, grid) as writer:
        for time, middle in ((0.0, 0.3), (30.0, 0.4)):
            plume = 0.5 * (1 - np.tanh((np.hypot(x - middle, z - 0.3) - 0.08) / 0.01))
            writer.append(time, plume, deviation=0.1 * plume, systematic=0.1 * plume)
    return path


def test_the_table_holds_the_move_and_the_mass(moving: Path, tmp_path: Path) -> None:
    table = tmp_path / 'plume.csv'
    result = porotwin('measure', moving, '--rig', small_rig(), '--output', table, '--json')
    assert result.returncode == 0, result.stderr
    first, second = json.loads(result.stdout)['rows']
    assert first['distance_m'] is None
    assert second['distance_m'] == pytest.approx(0.1, rel=0.01)
    assert second['x_m'] - first['x_m'] == pytest.approx(0.1, rel=0.01)
    assert second['mass_change'] == pytest.approx(0.0, abs=1e-3)
    assert second['tracer_deviation_ml'] == pytest.approx(0.1 * second['tracer_ml'], rel=1e-3)
    with table.open() as file:
        assert [float(row['time_s']) for row in csv.DictReader(file)] == [0.0, 30.0]


def test_the_screen_shows_few_rows_where_a_file_has_all(tmp_path: Path) -> None:
    rig = load_rig(small_rig())
    with ConcentrationWriter(tmp_path / 'maps.nc', rig.grid(9, 6)) as writer:
        for number in range(60):
            writer.append(30.0 * number, np.full((6, 9), 0.01))
    given = ['measure', tmp_path / 'maps.nc', '--rig', small_rig()]
    shown = porotwin(*given, '--output', tmp_path / 'plume.csv').stdout
    assert '1770' in shown
    assert len(shown.splitlines()) < 60 < len(porotwin(*given).stdout.splitlines())
    assert len((tmp_path / 'plume.csv').read_text().splitlines()) == 61


def test_open_water_hides_no_sand(moving: Path, tmp_path: Path) -> None:
    """Maps of photographs show nothing there, simulated ones do: both see all of the sand."""
    rig = yaml.safe_load(small_rig().read_text())
    corners = [[0.0, 0.4], [0.1, 0.4], [0.1, 0.562], [0.0, 0.562]]
    rig |= {
        'boundaries': {'top': 'closed'},
        'water': {'canal': {'corners_m': corners, 'head_m': 0.5}},
    }
    (moving.parent / 'rig.yaml').write_text(yaml.safe_dump(rig))
    result = porotwin('measure', moving, '--json')
    assert [row['seen'] for row in json.loads(result.stdout)['rows']] == [1.0, 1.0]
    description = load_rig(moving.parent)
    hidden = np.where(description.wet_sand(description.grid(94, 56)), 0.0, np.nan)
    path = tmp_path / 'hidden.nc'
    with ConcentrationWriter(path, description.grid(94, 56)) as writer:
        writer.append(0.0, hidden)
    (row,) = json.loads(porotwin('measure', path, '--json').stdout)['rows']
    assert row['seen'] == 1.0


def test_another_rig_than_the_one_beside_the_maps_is_told(moving: Path) -> None:
    text = small_rig().read_text()
    (moving.parent / 'rig.yaml').write_text(text.replace('porosity: 0.375', 'porosity: 0.2'))
    result = porotwin('measure', moving, '--rig', small_rig(), '--json')
    assert 'read with another rig.yaml, which differs in porosity' in result.stderr


def test_maps_are_compared_with_other_maps_at_the_same_time(moving: Path) -> None:
    result = porotwin(
        'measure', moving, '--rig', small_rig(), '--against', moving, '--side', 'up', '--json'
    )
    assert [row['distance_m'] for row in json.loads(result.stdout)['rows']] == [0.0, 0.0]


def test_maps_at_other_times_have_no_distance_and_are_told(moving: Path, tmp_path: Path) -> None:
    maps = open_maps(moving, load_rig(small_rig()))
    with ConcentrationWriter(tmp_path / 'later.nc', maps.grid) as writer:
        writer.append(3600.0, maps[0])
    result = porotwin(
        'measure', moving, '--rig', small_rig(), '--against', tmp_path / 'later.nc', '--json'
    )
    assert 'no map within 1 s of one of' in result.stderr
    assert 'it covers 3600 to 3600 s' in result.stderr


def test_a_porosity_among_the_effects_of_the_rig_counts(moving: Path, tmp_path: Path) -> None:
    described = Path(small_rig()).read_text(encoding='utf-8')
    effect = 'effects: [{name: porosity, parameters: {factor: 1.05}}]'
    (tmp_path / 'denser.yaml').write_text(f'{described}\n{effect}\n', encoding='utf-8')
    plain, corrected = (
        json.loads(porotwin('measure', moving, '--rig', rig, '--json').stdout)['rows'][0]
        for rig in (small_rig(), tmp_path / 'denser.yaml')
    )
    assert corrected['tracer_ml'] == pytest.approx(1.05 * plain['tracer_ml'])


def test_maps_without_a_rig_are_refused(moving: Path) -> None:
    result = porotwin('measure', moving)
    assert result.returncode == 2
    assert 'give one with --rig' in result.stderr


def test_the_table_does_not_replace_the_maps(moving: Path) -> None:
    before = moving.read_bytes()
    result = porotwin('measure', moving, '--rig', small_rig(), '--output', moving)
    assert result.returncode == 2
    assert 'is an input of this command' in result.stderr
    assert moving.read_bytes() == before


def test_empty_maps_and_plumes_far_above_stock_are_told(tmp_path: Path) -> None:
    grid = load_rig(small_rig()).grid(94, 56)
    path = tmp_path / 'maps.nc'
    with ConcentrationWriter(path, grid) as writer:
        for time, value in enumerate((np.nan, np.inf, 60.0, 0.5)):
            writer.append(float(time), np.full(grid.shape, value))
    result = porotwin('measure', path, '--rig', small_rig(), '--json')
    assert '2 of 4 maps hold no value, the first at 0 s' in result.stderr
    assert '1 of 4 maps have a plume above 1.3, the first at 2 s' in result.stderr
    assert 'values are read as not known: inf (5,264)' in result.stderr
    rows = json.loads(result.stdout)['rows']
    assert [row['seen'] for row in rows] == [0.0, 0.0, 1.0, 1.0]
    assert rows[0]['tracer_ml'] is None


def test_noisy_maps_in_percent_are_told(tmp_path: Path) -> None:
    grid = load_rig(small_rig()).grid(94, 56)
    path, noise = tmp_path / 'percent.nc', np.random.default_rng(1).random(grid.shape)
    plume = np.hypot(grid.x[None, :] - 0.4, grid.z[:, None] - 0.3) < 0.06
    with ConcentrationWriter(path, grid) as writer:
        writer.append(0.0, 100.0 * (0.01 * noise + plume))
    result = porotwin('measure', path, '--rig', small_rig(), '--json')
    assert '1 of 1 maps have a plume above 1.3' in result.stderr


def test_uncalibrated_maps_are_told_with_their_deviation(moving: Path, tmp_path: Path) -> None:
    rig = load_rig(small_rig())
    maps = open_maps(moving, rig)
    path = tmp_path / 'uncalibrated.nc'
    with ConcentrationWriter(path, maps.grid, origin=MapOrigin(calibrated=False)) as writer:
        writer.append(0.0, maps[0], deviation=0.2 * maps[0], systematic=0.2 * maps[0])
    arguments = ['measure', str(path), '--rig', str(small_rig()), '--json']
    result = CliRunner().invoke(app, arguments)
    assert 'on a default scale, known to about 20 %' in result.stderr
    assert json.loads(result.stdout)['calibrated'] is False


def test_maps_that_hide_a_part_of_the_rig_are_told(tmp_path: Path) -> None:
    rig = load_rig(small_rig())
    grid, path = rig.grid(94, 56), tmp_path / 'hidden.nc'
    hidden = np.full(grid.shape, 0.5)
    hidden[:, :10] = np.nan
    with ConcentrationWriter(path, grid) as writer:
        writer.append(0.0, np.full(grid.shape, 0.5))
        writer.append(30.0, hidden)
    result = porotwin('measure', path, '--rig', small_rig(), '--json')
    assert '1 of 2 maps hide more than 5 % of the rig (the one at 30 s 11 %)' in result.stderr
