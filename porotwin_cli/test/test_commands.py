"""The commands as a user types them: results, help, and one line for what is wrong."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import netCDF4
import numpy as np
import pytest
from typer.testing import CliRunner

from porotwin_cli import bench_costa, live_diagnosis
from porotwin_cli.app import app
from porotwin_cli.output import WorkFailed
from porotwin_cli.workspace import small_rig
from porotwin_core.rig import load_rig
from porotwin_core.units import from_ml_h
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_recording.recording import open_recording
from porotwin_rig.made_experiment import make_experiment

COMMANDS = sorted(str(command.name) for command in app.registered_commands)


def porotwin(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-m', 'porotwin_cli', *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=200,
    )


@pytest.fixture(scope='module')
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three minutes of the small rig on a coarse grid, with photographs."""
    folder = tmp_path_factory.mktemp('made') / 'experiment'
    rig = load_rig(small_rig())
    rate = from_ml_h(500.0)
    told = Schedule(
        (
            ScheduleRow(0.0, 'injector', WellRate(rate, 1.0)),
            ScheduleRow(0.0, 'producer', WellRate(-rate)),
        )
    )
    make_experiment(
        folder,
        rig,
        commanded=told,
        duration=180.0,
        photo_interval=30.0,
        seed=3,
        grid=rig.grid(94, 56),
        photo_width_px=800,
    )
    return folder


@pytest.mark.parametrize('command', [name for name in COMMANDS if name != 'test'])
def test_every_command_has_help_with_an_example(command: str) -> None:
    result = CliRunner().invoke(app, [command, '--help'], prog_name='porotwin')
    assert result.exit_code == 0
    assert f'Example: ./porotwin {command}' in ' '.join(result.stdout.split())


def test_simulate_follows_the_rig(experiment: Path, tmp_path: Path) -> None:
    result = porotwin('simulate', experiment, '--output', tmp_path / 'model.nc', '--json')
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)['grid'] == '94x56'
    recording = open_recording(experiment)
    with netCDF4.Dataset(tmp_path / 'model.nc') as dataset:
        model = np.asarray(dataset['concentration'][:])
    observed = np.asarray(recording.concentration)
    assert model.shape == observed.shape
    error = np.linalg.norm(model[-1] - observed[-1]) / np.linalg.norm(observed[-1])
    assert error < 0.1


def test_simulate_with_an_effect_differs(experiment: Path, tmp_path: Path) -> None:
    effect = 'rate:well=injector,factor=0.5'
    for name, extra in (('plain', []), ('weak', ['--effect', effect])):
        arguments = ['--output', tmp_path / f'{name}.nc', '--times', '0:180:90', *extra]
        result = porotwin('simulate', experiment, *arguments)
        assert result.returncode == 0
        assert '3 maps on 94x56' in result.stdout
    masses = []
    for name in ('plain', 'weak'):
        with netCDF4.Dataset(tmp_path / f'{name}.nc') as dataset:
            masses.append(float(np.sum(dataset['concentration'][-1])))
    assert masses[1] == pytest.approx(0.5 * masses[0], rel=0.05)


def test_image_turns_photographs_into_maps(experiment: Path, tmp_path: Path) -> None:
    output = tmp_path / 'maps.nc'
    result = porotwin('image', experiment, '--output', output, '--grid', '94x56', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert len(answer['maps']) == 6
    assert answer['refused'] == []
    with netCDF4.Dataset(output) as dataset:
        seen = np.ma.filled(dataset['concentration'][-1].astype(float), np.nan)
    assert np.nanmax(seen) > 0.5


def test_image_goes_on_without_photographs_that_cannot_be_used(
    experiment: Path, tmp_path: Path
) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    lines = (folder / 'imaging.csv').read_text().splitlines()
    names = [line.split(',')[1] for line in lines]
    time, _, role = lines[3].split(',')
    lines[4] = f'{time},{names[4]},{role}'
    (folder / 'imaging.csv').write_text('\n'.join(lines))
    (folder / names[5]).unlink()
    (folder / names[5]).symlink_to('/proc/self/mem')  # is there, and cannot be read by anybody
    output = tmp_path / 'maps.nc'
    result = porotwin('image', folder, '--output', output, '--grid', '94x56', '--json')
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert len(answer['maps']) == 4
    assert 'times must increase' in answer['refused'][0]
    assert answer['refused'][1] == f'{names[5]}: cannot be read (Input/output error)'
    with netCDF4.Dataset(output) as dataset:
        assert len(dataset['time']) == 4


def test_a_folder_survives_the_way_through_a_bag(experiment: Path, tmp_path: Path) -> None:
    imported = porotwin('import', experiment, tmp_path / 'bag')
    assert imported.returncode == 0
    assert '7 photographs' in imported.stdout
    result = porotwin('export', tmp_path / 'bag', tmp_path / 'again', '--json')
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)['photographs'] == 7
    before, after = open_recording(experiment), open_recording(tmp_path / 'again')
    np.testing.assert_array_equal(after.concentration, before.concentration)
    assert [p.read() for p in after.photos] == [p.read() for p in before.photos]
    assert after.schedule.at(100.0) == before.schedule.at(100.0)


@pytest.mark.slow
def test_costa_is_trained_and_evaluated(experiment: Path, tmp_path: Path) -> None:
    rig = experiment / 'rig.yaml'
    common = ['--grid', '94x56', '--preset', 'upwind', '--architecture', 'local', '--epochs', '2']
    trained = porotwin('train', experiment, '--rig', rig, '--output', tmp_path / 'm', *common)
    assert trained.returncode == 0, trained.stderr
    assert 'of the residual' in trained.stdout
    arguments = ['--preset', 'upwind', '--output', tmp_path / 'evaluation', '--json']
    result = porotwin('evaluate', tmp_path / 'm', experiment, *arguments)
    assert result.returncode == 0, result.stderr
    errors = json.loads(result.stdout)
    assert 0 < errors['corrected'] <= 1.5 * errors['predicted']
    assert (tmp_path / 'evaluation' / 'errors.csv').is_file()
    assert 'the model learned from it' in result.stderr
    for command in (['evaluate', tmp_path / 'm', experiment], ['up', *_up(experiment, tmp_path)]):
        refused = porotwin(*command, '--preset', 'fast')
        assert refused.returncode == 2, refused.stderr
        assert "model corrects preset 'upwind', not 'fast'" in refused.stderr


def _up(experiment: Path, folder: Path) -> list[str | Path]:
    rig = ['--rig', experiment / 'rig.yaml', '--grid', '94x56', '--model', folder / 'm']
    return [*rig, '--photos', experiment, '--output', folder / 'up']


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['simulate', 'nowhere', '--output', 'x.nc'], 'nowhere'),
        (['export', 'nowhere', 'there'], 'nowhere'),
        (['replay', 'nowhere'], 'nowhere'),
        (['image', 'nowhere', '--output', 'x.nc'], 'nowhere'),
        (['up', '--rig', 'nowhere.yaml', '--photos', '.'], 'nowhere.yaml'),
        (['bench', 'nothing'], "'nothing'"),
        (['evaluate', 'nowhere', 'there'], 'nowhere'),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments: list[str], named: str) -> None:
    result = porotwin(*arguments)
    assert result.returncode == 2, result.stderr
    assert named in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ''


def test_an_unknown_effect_or_grid_is_refused(experiment: Path, tmp_path: Path) -> None:
    for arguments, named in (
        (['--effect', 'magic:x=1'], "'magic'"),
        (['--grid', 'huge'], "'huge'"),
        (['--times', 'now'], "'now'"),
    ):
        result = porotwin('simulate', experiment, '--output', tmp_path / 'x.nc', *arguments)
        assert result.returncode == 2, result.stderr
        assert named in result.stderr
    assert not (tmp_path / 'x.nc').exists()


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['--preset', 'typo'], "'typo'"),
        (['--calibration', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--model', 'nowhere'], 'nowhere'),
        (['--page', 'somewhere'], "'somewhere'"),
        (['--grid', 'huge'], "'huge'"),
    ],
)
def test_up_refuses_what_a_node_would_refuse_before_it_starts_one(
    arguments: list[str], named: str, experiment: Path, tmp_path: Path
) -> None:
    output = tmp_path / 'up'
    common = ['--rig', experiment / 'rig.yaml', '--photos', experiment, '--output', output]
    result = porotwin('up', *common, *arguments)
    assert result.returncode == 2, result.stderr
    assert named in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not output.exists()


@pytest.mark.parametrize('arguments', [['--speed', 'abc'], ['--speed', '-1'], ['--preset', 'abc']])
def test_demo_refuses_before_it_works(arguments: list[str], tmp_path: Path) -> None:
    result = porotwin('demo', '--output', tmp_path / 'demo', *arguments)
    assert result.returncode == 2, result.stderr
    assert f"'{arguments[1]}'" in result.stderr
    assert not (tmp_path / 'demo').exists()


@pytest.mark.graph
def test_record_counts_what_it_recorded(tmp_path: Path) -> None:
    arguments = ['record', '--output', tmp_path / 'bag', '--json']
    process = subprocess.Popen(
        [sys.executable, '-m', 'porotwin_cli', *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60.0
    while not list(tmp_path.glob('bag/*.mcap')) and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal's Ctrl-C
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert json.loads(output)['messages'] >= 0


def test_a_live_diagnosis_does_not_outwait_the_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_diagnosis, 'LAST_ANSWER_S', 0.1)
    server = SimpleNamespace(server_is_ready=lambda: False)
    with pytest.raises(WorkFailed, match='the graph ended'):
        live_diagnosis._Patience(server)(Future())


@pytest.mark.slow
def test_costa_can_be_measured() -> None:
    (row,) = bench_costa.run(minutes=4.0, epochs=2, settings=('upwind',))
    assert 0.0 < row['with COSTA'] <= 1.5 * row['one step']


def test_up_wants_exactly_one_source_of_photographs(experiment: Path) -> None:
    result = porotwin('up', '--rig', experiment / 'rig.yaml')
    assert result.returncode == 2
    assert 'either --photos FOLDER or --camera DEVICE' in result.stderr
    both = porotwin('up', '--rig', experiment / 'rig.yaml', '--photos', experiment, '--replay')
    assert both.returncode == 2


def test_diagnose_wants_recordings_or_the_running_twin(tmp_path: Path) -> None:
    result = porotwin('diagnose', '--output', tmp_path / 'out')
    assert result.returncode == 2
    assert 'name recordings, or the running twin with --live' in result.stderr
