"""./porotwin diagnose."""

import shutil
from pathlib import Path

from cli_examples import porotwin


def test_diagnose_needs_recordings_or_the_running_twin(tmp_path: Path) -> None:
    result = porotwin('diagnose', '--output', tmp_path / 'out')
    assert result.returncode == 2
    assert 'name recordings, or the running twin with --live' in result.stderr


def test_a_live_diagnosis_takes_no_options_of_the_model(tmp_path: Path) -> None:
    result = porotwin('diagnose', '--live', '--output', tmp_path / 'out', '--preset', 'fast')
    assert result.returncode == 2
    assert 'leave out --rig, --preset, --apply, --each' in result.stderr


def test_a_copy_of_a_recording_does_not_count_twice(experiment: Path, tmp_path: Path) -> None:
    copy = tmp_path / 'copy'
    shutil.copytree(experiment, copy)
    result = porotwin('diagnose', experiment, copy, '--output', tmp_path / 'out')
    assert result.returncode == 2
    assert f'{copy}: is a copy of {experiment}' in result.stderr
