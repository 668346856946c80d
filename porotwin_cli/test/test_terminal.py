"""Output of the commands."""

import json
from pathlib import Path

import pytest

from porotwin_cli import terminal
from porotwin_cli.recorded.conversion import convert
from porotwin_cli.terminal import (
    as_argument,
    left_in_words,
    print_json,
    print_table,
    progress,
    refuse_existing,
    refuse_inside,
    say,
    seconds_left,
)
from porotwin_core.basis.errors import InputError


def test_json_has_text_for_paths_and_null_for_nan(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({'path': Path('a') / 'b', 'errors': [0.5, float('nan')], 'rows': ({1: 'x'},)})
    expected = {'path': 'a/b', 'errors': [0.5, None], 'rows': [{'1': 'x'}]}
    assert json.loads(capsys.readouterr().out) == expected


def test_a_proposed_command_takes_its_path_for_no_option() -> None:
    assert as_argument(Path('-x.nc')) == './-x.nc'
    assert as_argument(Path('two words.nc')) == "'two words.nc'"


def test_messages_go_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    say('working ...')
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ('', 'working ...\n')


def test_a_table_is_complete_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    print_table('figures [ml]', ('name', 'value'), [('[x]' + 60 * 'y', 1.25)])
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].strip() == 'figures [ml]'
    assert any('[x]' + 60 * 'y' in line and '1.25' in line for line in lines)


def test_existing_files_are_refused(tmp_path: Path) -> None:
    refuse_existing(tmp_path / 'new')
    with pytest.raises(InputError, match='exists already'):
        refuse_existing(tmp_path)


def test_progress_in_a_file_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress() as bar:  # short work prints nothing
        bar.advance(bar.add_task('short', total=2))
    assert capsys.readouterr().err.strip() == ''
    for name in ('LINE_EACH_S', 'STAGE_AFTER_S'):
        monkeypatch.setattr(terminal, name, 0.0)
    with progress() as bar:
        task = bar.add_task('fits', total=4)
        bar.advance(task)
        bar.update(task, completed=3.0, description='report')
    lines = capsys.readouterr().err.split('\n')
    assert [line for line in lines if line.startswith('fits: 25 %')]
    assert [line for line in lines if line.startswith('report: 75 %')]


def test_a_slow_piece_of_work_hardly_changes_the_remaining_time() -> None:
    now = 0.0
    with progress() as bar:
        bar.get_time = lambda: now
        task_id = bar.add_task('cases', total=100)
        task = bar.tasks[-1]
        for done in range(11):
            now = 60.0 * done
            bar.update(task_id, completed=done)
        assert task.time_remaining == pytest.approx(90 * 60.0, rel=0.2)
        now += 60.0
        bar.update(task_id, completed=10.1)
        assert task.time_remaining == pytest.approx(90 * 60.0, rel=0.25)


def test_the_remaining_time_grows_while_a_long_stage_makes_no_step() -> None:
    now = 0.0
    with progress() as bar:
        bar.get_time = lambda: now
        task_id = bar.add_task('diagnosis', total=100)
        task = bar.tasks[-1]
        for done in (0, 45, 90):
            now = done / 9.0
            bar.update(task_id, completed=done)
        assert seconds_left(task) == pytest.approx(10.0 / 9.0, abs=1.0)  # whole seconds
        now = 900.0
        assert seconds_left(task) == pytest.approx(100.0)


def test_a_slow_start_makes_no_estimate() -> None:
    now = 0.0
    with progress() as bar:
        bar.get_time = lambda: now
        number = bar.add_task('work', total=100)
        for completed, at, known in ((0.5, 20.0, False), (1.0, 40.0, False), (1.5, 310.0, True)):
            now = at
            bar.update(number, completed=completed)
            assert bool(left_in_words(bar.tasks[0])) is known


def test_a_task_may_know_its_remaining_time() -> None:
    with progress() as bar:
        bar.add_task('diagnosis', total=100, left=lambda: 'at most 9 min')
        assert left_in_words(bar.tasks[0]) == 'at most 9 min'


def test_a_target_inside_its_source_is_refused(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    bag.mkdir()
    with pytest.raises(InputError, match='lies inside'):
        convert(lambda *_, **__: None, bag, bag / 'sub', as_json=False)
    refuse_inside(bag, tmp_path / 'bag_2')
    refuse_inside(bag / 'bag.mcap', bag / 'sub')
