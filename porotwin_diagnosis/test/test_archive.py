"""An archive: its recordings one by one, and a second call that continues."""

import json
import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from lab.blind.blind_cases import SMALL
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import SchedulerLost, crew
from porotwin_core.rig import load_rig, write_rig
from porotwin_diagnosis import archive
from porotwin_diagnosis.archive import TABLE, ArchiveTask, archive_tasks, diagnose_archive
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report.origin import origin_of
from porotwin_diagnosis.report.report_folder import REPORT
from porotwin_recording.experiment.experiment_folder import COMMANDED_FILE
from porotwin_recording.experiment.recording import open_recording


@pytest.fixture
def monday(tmp_path: Path) -> Path:
    """A recording without maps: a rig and its rates."""
    return recorded(tmp_path / 'runs' / 'monday')


def recorded(folder: Path) -> Path:
    """Write a rig and rates into `folder` and return it."""
    folder.mkdir(parents=True)
    write_rig(SMALL, folder / 'rig.yaml')
    rows = 'time_s,well,rate_ml_h,concentration\n0,injector,450,1\n'
    (folder / COMMANDED_FILE).write_text(rows)
    return folder


def reported(task: ArchiveTask, *, made: dict[str, object] | None = None) -> ArchiveTask:
    """Write the report of `task` without a diagnosis, with `made` as its `made_with`."""
    task.folder.mkdir(parents=True, exist_ok=True)
    if made is None:
        read = origin_of(open_recording(task.recording, rig=task.rig))
        made = {'preset': task.preset, 'excluded': [], 'read': [read]}
    found = {
        'verdict': 'rate', 'combination': ['rate'], 'confidence': 0.9,
        'recordings': [str(task.recording)], 'made_with': made,
    }  # fmt: skip
    (task.folder / 'diagnosis.json').write_text(json.dumps(found))
    (task.folder / REPORT).touch()
    return task


def test_a_recording_with_a_report_is_kept_and_a_bad_one_is_named(
    monday: Path, tmp_path: Path
) -> None:
    tasks = archive_tasks([monday, tmp_path / 'tuesday'], tmp_path / 'archive')
    reported(tasks[0])
    named: list[str] = []
    with crew(workers=2, threads=True) as pool:
        table = diagnose_archive(tasks, tmp_path / 'archive', pool, named.append)
    assert named == ['tuesday']
    assert [row['verdict'] for row in table] == ['rate', None]
    assert 'tuesday' in table[1]['refused']
    assert json.loads((tmp_path / 'archive' / TABLE).read_text()) == table


def test_a_rig_file_means_its_recording(monday: Path, tmp_path: Path) -> None:
    output = tmp_path / 'archive'
    (task,) = archive_tasks([monday / 'rig.yaml'], output)
    assert (task.recording, task.folder) == (monday, output / 'monday')
    with pytest.raises(InputError, match=r'monday is named twice'):
        archive_tasks([monday, monday / 'rig.yaml'], output)


def test_a_file_is_no_folder_for_reports(monday: Path, tmp_path: Path) -> None:
    (tmp_path / 'archive').touch()
    tasks = archive_tasks([monday], tmp_path / 'archive')
    with crew(workers=1, threads=True) as pool, pytest.raises(InputError, match='is a file; name'):
        diagnose_archive(tasks, tmp_path / 'archive', pool)


def test_a_second_call_keeps_the_rows_of_other_recordings(monday: Path, tmp_path: Path) -> None:
    output = tmp_path / 'archive'
    recordings = [monday, recorded(tmp_path / 'runs' / 'tuesday')]
    tasks = [reported(task) for task in archive_tasks(recordings, output)]
    with crew(workers=1, threads=True) as pool:
        both = diagnose_archive(tasks, output, pool)
        assert diagnose_archive(tasks[1:], output, pool) == both[1:]
        assert json.loads((output / TABLE).read_text()) == both
        (tasks[0].folder / REPORT).unlink()
        (tasks[0].folder / 'diagnosis.json').unlink()
        tasks[0].folder.rmdir()
        diagnose_archive(tasks[1:], output, pool)
    assert json.loads((output / TABLE).read_text()) == both[1:]


def edited(recording: Path, name: str, old: str, new: str) -> None:
    """Replace a text in a file of `recording`, at another time."""
    path = recording / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    os.utime(path, (1e9, 1e9))


CHANGES: dict[str, Callable[[ArchiveTask], ArchiveTask]] = {
    'belongs to /': lambda task: replace(
        task, recording=recorded(task.recording.parent / 'next' / 'monday')
    ),
    'preset accurate': lambda task: replace(task, preset='fast'),
    'another description of the rig': lambda task: replace(
        task, rig=SMALL.model_copy(update={'viscosity_pa_s': 1.1e-3})
    ),
}


@pytest.mark.parametrize('words', CHANGES)
def test_a_report_of_another_task_is_not_taken_for_its_own(
    words: str, monday: Path, tmp_path: Path
) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    assert task.is_done, task.difference
    other = CHANGES[words](task)
    assert not other.is_done
    assert words in other.difference


@pytest.mark.parametrize(
    ('name', 'old', 'new'),
    [(COMMANDED_FILE, '450', '460'), ('rig.yaml', 'porosity: 0.375', 'porosity: 0.385')],
)
def test_a_report_of_a_recording_that_has_changed_is_made_again(
    name: str, old: str, new: str, monday: Path, tmp_path: Path
) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    edited(monday, name, old, new)
    assert not task.is_done


def test_a_comment_in_the_rig_makes_no_diagnosis_again(monday: Path, tmp_path: Path) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    edited(monday, 'rig.yaml', 'porosity: 0.375', 'porosity: 0.375  # as packed')
    assert task.is_done
    given = ArchiveTask(monday, task.folder, rig=load_rig(monday))
    assert given.is_done, 'the same rig by --rig'


@pytest.mark.parametrize(
    ('path', 'preset', 'done'),
    [('monday', 'accurate', True), ('monday', 'fast', False), ('../monday', 'accurate', False)],
)
def test_an_old_report_counts_by_recording_and_preset(
    path: str, preset: str, done: bool, monday: Path, tmp_path: Path
) -> None:
    task = ArchiveTask(monday, tmp_path / 'archive' / 'monday')
    old = replace(task, recording=monday.parent / path)
    reported(old, made={'preset': preset, 'excluded': []})
    assert task.is_done is done


def test_a_report_that_began_with_a_belief_is_made_again(monday: Path, tmp_path: Path) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    path = task.folder / 'diagnosis.json'
    found = json.loads(path.read_text())
    for belief, done in ((None, True), ({'rate': 0.9}, False)):
        path.write_text(json.dumps({**found, 'belief': belief}))
        assert task.is_done is done


def test_a_report_of_a_search_that_was_ended_is_made_again(monday: Path, tmp_path: Path) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    path = task.folder / 'diagnosis.json'
    found = json.loads(path.read_text())
    path.write_text(json.dumps({**found, 'untried': 'pairs of effects'}))
    assert task.difference == 'its search was ended before it tried pairs of effects'


def test_a_damaged_report_is_made_again(monday: Path, tmp_path: Path) -> None:
    task = reported(ArchiveTask(monday, tmp_path / 'archive' / 'monday'))
    for damaged in ('{', '[]', '{"verdict": "rate"}'):
        (task.folder / 'diagnosis.json').write_text(damaged)
        assert 'does not tell the origin' in task.difference


def test_a_report_that_is_made_again_is_told(
    monday: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    output = tmp_path / 'archive'
    reported(ArchiveTask(monday, output / 'monday', preset='fast'))
    with crew(workers=1, threads=True) as pool, caplog.at_level(logging.WARNING, 'porotwin'):
        table = diagnose_archive(archive_tasks([monday], output), output, pool)
    assert [record.getMessage() for record in caplog.records if 'again' in record.getMessage()] == [
        f'{output / "monday"}: the report was made with the preset fast; it is diagnosed again'
    ]
    assert 'maps' in table[0]['refused'], 'it was tried'


@pytest.mark.parametrize(
    ('fault', 'told'),
    [(ZeroDivisionError('of nothing'), 'failed: ZeroDivisionError'), (OSError('no disk'), 'no d')],
)
def test_a_fault_in_one_recording_costs_no_other_its_diagnosis(
    monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: Exception, told: str
) -> None:
    tuesday = recorded(tmp_path / 'runs' / 'tuesday')

    def work(task: ArchiveTask) -> None:
        if task.recording == monday:
            raise fault
        reported(task)

    monkeypatch.setattr(ArchiveTask, 'work', work)
    output = tmp_path / 'archive'
    with crew(workers=1, threads=True) as pool:
        table = diagnose_archive(archive_tasks([monday, tuesday], output), output, pool)
    assert table[0]['refused'].startswith(told)
    assert table[1]['verdict'] == 'rate'


def test_a_lost_scheduler_is_no_fault_of_a_recording(
    monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(_task: ArchiveTask) -> None:
        raise SchedulerLost('scheduler tcp://head:8786: went away')

    monkeypatch.setattr(ArchiveTask, 'work', work)
    output = tmp_path / 'archive'
    with crew(workers=1, threads=True) as pool, pytest.raises(SchedulerLost):
        diagnose_archive(archive_tasks([monday], output), output, pool)


def test_a_recording_that_changes_meanwhile_is_refused(
    monday: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def examine(*_: object, **__: object) -> None:
        edited(monday, COMMANDED_FILE, '450', '460')

    monkeypatch.setattr(archive, 'examine', examine)
    with pytest.raises(InputError, match='changed during its diagnosis'):
        ArchiveTask(monday, tmp_path / 'archive' / 'monday').work()


def test_a_diagnosis_that_was_written_is_done(
    denser: Diagnosis, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archive, 'examine', lambda *_, **__: denser)
    task = ArchiveTask(denser.recordings[0].source, tmp_path / 'archive' / 'recording')
    assert not task.has_report
    task.work()
    assert task.is_done, task.difference
    assert not replace(task, preset='fast').is_done


def test_an_archive_in_the_folder_of_a_recording_is_refused(monday: Path) -> None:
    for recording in (monday, monday / 'rig.yaml'):
        with pytest.raises(InputError, match='name another folder'):
            archive_tasks([recording], monday)


def test_two_recordings_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="two recordings are called 'monday'"):
        archive_tasks([tmp_path / 'a' / 'monday', tmp_path / 'b' / 'monday'], tmp_path)


def test_a_recording_that_is_named_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='monday is named twice'):
        archive_tasks([tmp_path / 'a' / 'monday'] * 2, tmp_path / 'out')
