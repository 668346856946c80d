"""./porotwin train and evaluate."""

import json
import shutil
from pathlib import Path

import pytest
from cli_examples import porotwin

from porotwin_cli.recorded.costa_data import references_of
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import open_maps


@pytest.mark.slow
def test_costa_is_trained_and_evaluated(experiment: Path, tmp_path: Path) -> None:
    rig = experiment / 'rig.yaml'
    common = ['--grid', '47x28', '--preset', 'upwind', '--architecture', 'local', '--epochs', '2']
    trained = porotwin('train', experiment, '--rig', rig, '--output', tmp_path / 'm', *common)
    assert trained.returncode == 0, trained.stderr
    assert 'gate' in trained.stdout
    arguments = ['--preset', 'upwind', '--output', tmp_path / 'evaluation', '--json']
    result = porotwin('evaluate', tmp_path / 'm', experiment, *arguments)
    assert result.returncode == 0, result.stderr
    errors = json.loads(result.stdout)
    assert 0 < errors['corrected'] <= 1.5 * errors['predicted']
    (recording,) = errors['recordings'].values()
    late = recording['free_running_last_30_percent']
    assert late['costa'] <= 1.02 * late['model']
    assert (tmp_path / 'm.pairs').is_file()
    assert (tmp_path / 'evaluation' / 'errors.csv').is_file()
    for kind in ('observed', 'free_run', 'corrected'):
        maps = open_maps(tmp_path / 'evaluation' / f'maps_{kind}.nc', load_rig(rig))
        assert maps.grid.shape == (28, 47)
        assert len(maps) > 1
    itself = porotwin(
        'evaluate', tmp_path / 'm', experiment, *arguments[:2], '--json',
        '--reference', tmp_path / 'evaluation' / 'maps_free_run.nc',
    )  # fmt: skip
    assert itself.returncode == 0, itself.stderr
    assert json.loads(itself.stdout)['free_predicted'] < 1e-6
    assert 'the model learned from it' in result.stderr
    for command in (['evaluate', tmp_path / 'm', experiment], ['up', *_up(experiment, tmp_path)]):
        refused = porotwin(*command, '--preset', 'fast')
        assert refused.returncode == 2, refused.stderr
        assert "model corrects preset 'upwind', not 'fast'" in refused.stderr

    cut = porotwin('export', experiment, tmp_path / 'part', '--times', '0:150')
    assert cut.returncode == 0, cut.stderr
    text = (tmp_path / 'part' / 'rig.yaml').read_text()
    (tmp_path / 'part' / 'rig.yaml').write_text(text.replace('porosity: 0.', 'porosity: 0.1'))
    both = porotwin('evaluate', tmp_path / 'm', experiment, tmp_path / 'part', *arguments[:2])
    assert both.returncode == 2, both.stdout
    assert 'part: model corrects rig' in both.stderr


def _up(experiment: Path, folder: Path) -> list[str | Path]:
    rig = ['--rig', experiment / 'rig.yaml', '--grid', '47x28', '--model', folder / 'm']
    return [*rig, '--photos', experiment, '--output', folder / 'up']


def test_evaluate_refuses_a_file_as_output_before_it_works(tmp_path: Path) -> None:
    (taken := tmp_path / 'table.csv').write_text('')
    result = porotwin('evaluate', tmp_path / 'model', tmp_path, '--output', taken)
    assert result.returncode == 2
    assert 'is a file; name a folder' in result.stderr


def test_evaluate_wants_a_reference_for_each_recording(experiment: Path, tmp_path: Path) -> None:
    grid = load_rig(experiment / 'rig.yaml').default_grid()
    one = open_recording(experiment)
    with pytest.raises(InputError, match='1 files for 2 recordings'):
        references_of([tmp_path / 'truth.nc'], [one, one], grid)


def test_train_refuses_an_unknown_network_before_it_works(experiment: Path, tmp_path: Path) -> None:
    arguments = ['--rig', experiment / 'rig.yaml', '--architecture', 'cubist']
    result = porotwin('train', experiment, '--output', tmp_path / 'm', *arguments)
    assert result.returncode == 2
    assert "architecture 'cubist': unknown; choose from" in result.stderr


@pytest.mark.parametrize(('copied', 'told'), [(False, 'is named twice'), (True, 'is a copy of')])
def test_train_refuses_a_recording_that_would_judge_itself(
    experiment: Path, tmp_path: Path, copied: bool, told: str
) -> None:
    second = tmp_path / 'copy' if copied else experiment
    if copied:
        shutil.copytree(experiment, second)
    arguments = ['--rig', experiment / 'rig.yaml', '--output', tmp_path / 'm', '--grid', '31x19']
    result = porotwin('train', experiment, second, *arguments)
    assert result.returncode == 2
    assert f'{second}: {told}' in result.stderr
    assert not (tmp_path / 'm').exists()


def test_train_needs_two_maps(experiment: Path, tmp_path: Path) -> None:
    part = porotwin('export', experiment, tmp_path / 'one', '--times', '60:61')
    assert part.returncode == 0, part.stderr
    arguments = ['--rig', experiment / 'rig.yaml', '--output', tmp_path / 'm', '--grid', '31x19']
    result = porotwin('train', tmp_path / 'one', *arguments)
    assert result.returncode == 2
    assert 'one: holds one map' in result.stderr
