"""The run of a blind check: it continues where it stopped, and survives a failure."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from subprocess import CalledProcessError
from threading import Event

import pytest
from diagnosis_examples import all_but

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import SchedulerLost
from porotwin_validation import blind_study
from porotwin_validation.blind_cases import draw_case
from porotwin_validation.blind_study import IN_WORK, blind_check, run_with_shares, work_through
from porotwin_validation.case_progress import CaseProgress


def light_case(number, seed):
    """Return a short case on large cells, diagnosed with one effect."""
    return replace(
        draw_case(number, seed),
        duration=1800.0,
        cell_m=0.02,
        element_m=0.01,
        withheld=all_but('porosity'),
    )


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

    cases = [draw_case(number, 1) for number in range(3)]
    events = []
    failed = work_through(
        tmp_path,
        cases,
        ThreadPoolExecutor(2),
        lambda done, event: events.append((done, event)),
        work=fails_once,
    )
    assert failed == {'case_001'}
    assert sorted(event for _, event in events) == [
        'case_000 diagnosed',
        'case_001 failed',
        'case_002 diagnosed',
    ]
    assert [done for done, _ in events] == [1, 2, 3]


def test_parts_of_a_case_are_told_while_it_is_in_work(tmp_path, monkeypatch):
    monkeypatch.setattr(blind_study, 'LOOK_EACH_S', 0.01)
    seen, events = Event(), []

    def half_done(_case, folder):
        with CaseProgress(folder) as progress:
            progress(0.5)
            assert seen.wait(30.0)

    def told(done, event):
        events.append((done, event))
        if done == 0.5:
            seen.set()

    work_through(tmp_path, [draw_case(0, 1)], ThreadPoolExecutor(1), told, work=half_done)
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

    cases = [draw_case(number, 1) for number in range(3)]
    with pytest.raises(SchedulerLost):
        work_through(tmp_path, cases, ThreadPoolExecutor(1), lambda *_: None, work=work)
    lost, missing = False, [case for case in cases if not (tmp_path / case.name).exists()]
    assert cases[0] not in missing
    assert not work_through(tmp_path, missing, ThreadPoolExecutor(1), lambda *_: None, work=work)
    assert all((tmp_path / case.name).exists() for case in cases)


def test_a_fault_of_the_check_itself_ends_it(tmp_path):
    def broken(_case, _folder):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        work_through(
            tmp_path, [draw_case(0, 1)], ThreadPoolExecutor(1), lambda *_: None, work=broken
        )


def test_an_output_that_is_a_file_is_refused(tmp_path):
    (tmp_path / 'blind').touch()
    with pytest.raises(InputError, match='is a file; name a folder'):
        blind_check(tmp_path / 'blind', cases=1)
