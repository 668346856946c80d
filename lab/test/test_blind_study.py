"""The run of a blind check: it continues where it stopped, and survives a failure."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from subprocess import CalledProcessError
from threading import Event

import pytest
from diagnosis_examples import all_but

from lab import study
from lab.blind.blind_cases import draw_case
from lab.blind.blind_study import COMPARISON, FAILURES, CaseJob, blind_check, run_with_shares
from lab.blind.case_progress import CaseProgress
from lab.study import IN_WORK, missing_jobs, work_through
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import SchedulerLost


def light_case(number, seed):
    """Return a short case on large cells, diagnosed with one effect."""
    return replace(
        draw_case(number, seed),
        duration=1200.0,
        cell_m=0.02,
        element_m=0.01,
        withheld=all_but('porosity'),
    )


def jobs(folder, count, work):
    """Return jobs of so many cases, with `work` in place of a diagnosis."""
    cases = [draw_case(number, 1) for number in range(count)]
    return [CaseJob(case, folder / case.name / COMPARISON, work) for case in cases]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_check_continues_where_it_stopped(tmp_path):
    first = blind_check(tmp_path, cases=1, draw=light_case)
    stamp = (tmp_path / 'case_000' / 'result' / 'diagnosis.json').stat().st_mtime_ns
    events = []
    again = blind_check(
        tmp_path,
        cases=1,
        draw=light_case,
        progress=lambda _done, _all, event: events.append(event),
    )
    assert again == first
    assert events == ['done']
    assert (tmp_path / 'case_000' / 'result' / 'diagnosis.json').stat().st_mtime_ns == stamp
    assert not list((tmp_path / 'case_000' / 'recording').glob('*truth*'))
    assert first['right'] == 1.0
    assert 'confusion' in (tmp_path / 'report.md').read_text().lower()


def test_a_failed_case_does_not_stop_the_others(tmp_path):
    def fails_once(case, _folder):
        if case.name == 'case_001':
            raise CalledProcessError(2, 'diagnosis')

    events = []
    failed = work_through(
        jobs(tmp_path, 3, fails_once),
        ThreadPoolExecutor(2),
        lambda done, event: events.append((done, event)),
        forgiven=FAILURES,
    )
    assert failed == {'case_001'}
    assert sorted(event for _, event in events) == [
        'case_000 diagnosed',
        'case_001 failed',
        'case_002 diagnosed',
    ]
    assert [done for done, _ in events] == [1, 2, 3]


def test_parts_of_a_case_are_told_while_it_is_in_work(tmp_path, monkeypatch):
    monkeypatch.setattr(study, 'LOOK_EACH_S', 0.01)
    seen, events = Event(), []

    def half_done(_case, folder):
        with CaseProgress(folder) as progress:
            progress(0.5)
            assert seen.wait(30.0)

    def told(done, event):
        events.append((done, event))
        if done == 0.5:
            seen.set()

    work_through(jobs(tmp_path, 1, half_done), ThreadPoolExecutor(1), told)
    assert (0.5, IN_WORK) in events
    assert events[-1] == (1, 'case_000 diagnosed')


def test_a_process_tells_its_shares_and_its_failure():
    told = []
    program = 'print(0.25, flush=True); print("a library speaks"); print(0.5); raise SystemExit({})'
    run_with_shares([sys.executable, '-c', program.format(0)], dict(os.environ), told.append)
    assert told == [0.25, 0.5]
    with pytest.raises(CalledProcessError):
        run_with_shares([sys.executable, '-c', program.format(2)], dict(os.environ), told.append)


def test_a_lost_scheduler_ends_the_check_and_a_second_call_goes_on(tmp_path):
    lost = True

    def work(case, folder):
        if lost and case.name == 'case_001':
            raise SchedulerLost('scheduler tcp://head:8786: went away')
        folder.mkdir()
        (folder / COMPARISON).touch()

    cases = jobs(tmp_path, 3, work)
    with pytest.raises(SchedulerLost):
        work_through(cases, ThreadPoolExecutor(1), lambda *_: None, forgiven=FAILURES)
    lost, missing = False, missing_jobs(cases)
    assert cases[0] not in missing
    assert not work_through(missing, ThreadPoolExecutor(1), lambda *_: None, forgiven=FAILURES)
    assert missing_jobs(cases) == []


def test_a_fault_of_the_check_itself_ends_it(tmp_path):
    def broken(_case, _folder):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        work_through(
            jobs(tmp_path, 1, broken), ThreadPoolExecutor(1), lambda *_: None, forgiven=FAILURES
        )


def test_an_output_that_is_a_file_is_refused(tmp_path):
    (tmp_path / 'blind').touch()
    with pytest.raises(InputError, match='is a file; name a folder'):
        blind_check(tmp_path / 'blind', cases=1)
