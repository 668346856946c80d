"""./porotwin up."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from cli_examples import TIMEOUT_S, porotwin
from patience import until

from porotwin_cli.running import live_twin
from porotwin_core.rig import load_rig
from porotwin_core.ros.ros_environment import DomainClaim, domain_of


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['--preset', 'typo'], "'typo'"),
        (['--calibration', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--model', 'nowhere'], 'nowhere'),
        (['--page', 'somewhere'], "'somewhere'"),
        (['--grid', 'huge'], "'huge'"),
        (['--architecture', 'cubist'], "'cubist'"),
        (['--params', 'parameters.yaml'], "'horizon' is no parameter of hub"),
    ],
)
def test_up_checks_arguments_before_it_starts_a_node(
    arguments: list[str],
    named: str,
    experiment: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('parameters.yaml').write_text('hub: {ros__parameters: {horizon: 9.0}}')
    output = tmp_path / 'up'
    common = ['--rig', experiment / 'rig.yaml', '--photos', experiment, '--output', output]
    result = porotwin('up', *common, *arguments)
    assert result.returncode == 2, result.stderr
    assert named in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not output.exists()


def test_a_twin_without_a_network_starts_without_torch() -> None:
    script = "import sys, porotwin_cli.running.live_twin; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, '-c', script], check=False).returncode == 0


def test_up_prints_a_template_of_all_parameters() -> None:
    result = porotwin('up', '--params-template')
    assert result.returncode == 0, result.stderr
    nodes = yaml.safe_load(result.stdout)
    assert nodes['/porotwin/supervisor']['ros__parameters']['restart_after_s'] == 30.0
    assert nodes['/porotwin/hub']['ros__parameters']['model_timeout_s'] == 20.0
    assert '    # rig: ' in result.stdout


def test_up_names_a_wrong_variable_of_ros(
    experiment: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_nothing_cpp')
    result = porotwin('up', '--rig', experiment / 'rig.yaml', '--photos', experiment)
    assert result.returncode == 2, result.stderr
    assert 'RMW_IMPLEMENTATION is rmw_nothing_cpp' in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_a_second_graph_in_the_domain_is_refused(experiment: Path, tmp_path: Path) -> None:
    with DomainClaim(domain_of(os.environ)):
        result = porotwin(
            *('up', '--rig', experiment / 'rig.yaml', '--photos', experiment),
            *('--output', tmp_path / 'up'),
        )
    assert result.returncode == 2, result.stderr
    assert 'set ROS_DOMAIN_ID to another number' in result.stderr
    assert not (tmp_path / 'up').exists()


def test_up_needs_exactly_one_source_of_photographs(experiment: Path) -> None:
    result = porotwin('up', '--rig', experiment / 'rig.yaml')
    assert result.returncode == 2
    assert 'either --photos FOLDER or --camera SOURCE' in result.stderr
    both = porotwin('up', '--rig', experiment / 'rig.yaml', '--photos', experiment, '--replay')
    assert both.returncode == 2


@pytest.mark.graph
@pytest.mark.slow
def test_up_gives_the_trainer_a_folder_of_the_run_and_the_chosen_network(
    experiment: Path, tmp_path: Path
) -> None:
    output, photos = tmp_path / 'run', tmp_path / 'photos'
    photos.mkdir()
    arguments = ['--rig', experiment / 'rig.yaml', '--photos', photos, '--output', output]
    arguments += ['--retrain-every', '5', '--architecture', 'local', '--page', '']
    arguments += ['--no-siblings', '--no-diagnosis']  # two processes less
    process = subprocess.Popen(
        [sys.executable, '-m', 'porotwin_cli', 'up', *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    log = output / 'log' / 'trainer.log'
    try:
        until(lambda: process.poll() or (log.is_file() and 'training pairs in' in log.read_text()))
        assert process.poll() is None
    finally:
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    assert f'training pairs in {output}/training/pairs: 0 so far' in log.read_text()
    (description,) = yaml.safe_load((output / 'log' / 'trainer.yaml').read_text()).values()
    parameters = description['ros__parameters']
    assert parameters['output'] == str(output / 'training' / 'model.safetensors')
    assert parameters['architecture'] == 'local'
    assert parameters['retrain_every'] == 5
    kept = Path(parameters['rig'])  # an edited rig.yaml must not reach one node that starts again
    assert kept.parent == output / 'rig'
    assert load_rig(kept).physics_fingerprint == load_rig(experiment).physics_fingerprint


def test_up_that_ends_before_its_recorder_runs_names_no_bag(
    experiment: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_twin, 'run_until_stopped', lambda *_: None)
    arguments = ['--rig', experiment / 'rig.yaml', '--photos', experiment]
    result = porotwin('up', *arguments, '--output', tmp_path / 'up', '--page', '')
    assert result.returncode == 0, result.stderr
    assert result.stdout == f'logs in {tmp_path / "up"}\n'
