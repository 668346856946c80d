"""The start of an experiment survives a restart of imaging."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.live.experiment_start import ExperimentStart


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


def test_a_restarted_process_leaves_out_the_baselines_of_earlier_experiments(
    tmp_path: Path,
) -> None:
    file = tmp_path / 'start.json'
    running = ExperimentStart(file)
    running.note(100.0, ['a0', 'a1'])
    assert not running.is_over(90.0, 'b')  # before the first photograph of the next experiment
    running.note(500.0, ['b'])
    again = ExperimentStart(file)
    assert [again.is_over(90.0, name) for name in ('a0', 'a1')] == [True, True]
    assert not again.is_over(400.0, 'b')
    assert not again.is_over(600.0, 'c'), 'it was taken since'
    assert again.goes_on(610.0)
    assert not again.is_over(90.0, 'd'), 'whoever offers an old photograph now wants it'


def test_without_noted_baselines_all_count(tmp_path: Path) -> None:
    file = tmp_path / 'start.json'
    file.write_text('{"first_photograph_s": 100.0}')
    assert not ExperimentStart(file).is_over(90.0, 'a')


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / 'start.json'
    for text in (
        '{"first_photograph_s": "soon"}',
        '[]',
        '[' * 200_000,
        f'{{"first_photograph_s": {10**400}}}',
        '{"first_photograph_s": 1, "baselines": 2}',
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=r'start\.json: holds no time .* delete it'):
            ExperimentStart(file)
