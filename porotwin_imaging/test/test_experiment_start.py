"""The start of an experiment survives a restart of imaging."""

from pathlib import Path

import pytest

from porotwin_core.errors import InputError
from porotwin_imaging.experiment_start import ExperimentStart


def test_an_experiment_goes_on_after_a_restart_only(tmp_path: Path) -> None:
    file = tmp_path / 'run' / 'start.json'
    first = ExperimentStart(file)
    assert not first.goes_on(100.0)
    first.note(100.0)
    assert not first.goes_on(500.0)  # a new baseline began another experiment
    second = ExperimentStart(file)
    assert second.time == 100.0
    assert second.goes_on(500.0)
    assert not second.goes_on(600.0)
    assert not ExperimentStart(file).goes_on(50.0)  # its photograph is older


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / 'start.json'
    file.write_text('{"first_photograph_s": "soon"}')
    with pytest.raises(InputError, match=r'start\.json: holds no time .* delete it'):
        ExperimentStart(file)
