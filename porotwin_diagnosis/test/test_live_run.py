"""The run of a live twin: when it begins, and how it becomes a recording."""

import os

import numpy as np
import pytest
from diagnosis_examples import SMALL

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_core.rates.wells import WellRate
from porotwin_diagnosis.data.initial_tracer import initial_tracer
from porotwin_diagnosis.data.live_run import KEPT_RUNS, MOST_MAPS, LiveRun, forget_old_runs
from porotwin_recording.experiment.recording import open_recording
from porotwin_recording.tables.concentration import MapOrigin

GRID = SMALL.grid(20, 12)
EMPTY = np.zeros(GRID.shape)
FULL = np.full(GRID.shape, 0.8)
INJECTING = {'injector': WellRate(1e-7, 1.0)}


def run_with_maps(*stamps, first=EMPTY):
    run = LiveRun(SMALL, GRID)
    for number, stamp in enumerate(stamps):
        run.add_map(stamp, FULL if number else first, GRID)
    return run


def written(run, folder):
    run.write(folder)
    return open_recording(folder)


def test_times_are_counted_from_the_beginning_of_the_run(tmp_path):
    run = run_with_maps(1.7e9, 1.7e9 + 30.0, 1.7e9 + 60.0)
    run.rates.add_known(KnownRates(1.7e9 + 30.0, 1.7e9 + 60.0, INJECTING))
    recording = written(run, tmp_path / 'run')
    assert recording.times == pytest.approx([0.0, 30.0, 60.0])
    assert recording.schedule.at(29.0) == {}
    assert recording.schedule.at(30.0) == INJECTING


def test_missed_photographs_do_not_end_a_run():
    assert run_with_maps(0.0, 30.0, 600.0).times == (0.0, 30.0, 600.0)


def test_a_clock_that_goes_back_begins_a_run_with_the_rates_in_force(tmp_path):
    run = run_with_maps(0.0, 30.0)
    run.rates.add_known(KnownRates(10.0, 10.0, INJECTING))
    run.add_map(5.0, EMPTY, GRID)
    recording = written(run, tmp_path / 'run')
    assert list(recording.times) == [0.0]
    assert recording.schedule.at(0.0) == INJECTING


def test_a_clock_that_is_set_right_by_years_begins_a_run():
    years = 4 * 365 * 86400.0
    assert run_with_maps(0.0, 30.0, years, years + 30.0).times == (years, years + 30.0)


def test_an_ended_run_is_kept_until_another_one_begins():
    run = run_with_maps(0.0, 30.0)
    run.note_experiment_end()
    assert run.times == (0.0, 30.0)
    run.add_map(900.0, EMPTY, GRID)
    assert run.times == (900.0,)


def test_the_end_of_an_experiment_without_maps_ends_no_later_one():
    run = LiveRun(SMALL, GRID)  # the node was started again after the last photograph
    run.note_experiment_end()
    for stamp in (900.0, 930.0):
        run.add_map(stamp, EMPTY, GRID)
    assert run.times == (900.0, 930.0)


def test_a_run_whose_beginning_was_missed_starts_with_its_first_map(tmp_path):
    for since in (3000.0, 2970.0):  # the rates arrive with the first map, or just before it
        run = run_with_maps(3000.0, 3030.0, first=FULL)
        run.rates.add_known(KnownRates(since, 3000.0, INJECTING))
        first = initial_tracer(written(run, tmp_path / f'since {since:g}'))
        assert first is not None and np.allclose(first, FULL)
    run = run_with_maps(30000.0, 30030.0, first=FULL)
    run.rates.add_known(KnownRates(0.0, 30000.0, INJECTING))  # accounts for the tracer
    assert initial_tracer(written(run, tmp_path / 'seen')) is None


def test_a_run_without_rates_is_refused(tmp_path):
    with pytest.raises(InputError, match='no rates have arrived'):
        run_with_maps(0.0, 30.0).write(tmp_path / 'run')


def test_a_run_without_maps_is_refused(tmp_path):
    with pytest.raises(InputError, match='no map has arrived'):
        run_with_maps().write(tmp_path / 'run')


def test_a_setpoint_counts_as_followed_until_rates_are_measured(tmp_path):
    other = {'injector': WellRate(5e-8, 1.0)}
    run = run_with_maps(0.0, 30.0, 60.0, 90.0)
    run.rates.add_commanded(0.0, INJECTING)
    run.rates.add_commanded(30.0, INJECTING)
    run.rates.add_known(KnownRates(30.0, 60.0, other))
    run.rates.add_commanded(30.0, INJECTING)  # arrives late
    run.rates.add_commanded(60.0, INJECTING)
    schedule = written(run, tmp_path / 'run').schedule
    assert [schedule.at(t)['injector'].rate for t in (0.0, 29.0, 30.0, 59.0, 60.0)] == [
        1e-7, 1e-7, 5e-8, 5e-8, 1e-7
    ]  # fmt: skip


def test_a_new_evaluation_begins_a_run_if_the_tracer_is_gone():
    run = run_with_maps(0.0, 30.0, 60.0)
    run.note_evaluation_start()
    run.add_map(90.0, FULL, GRID)  # the evaluation was restarted within the experiment
    assert len(run.times) == 4
    run.note_evaluation_start()
    run.add_map(120.0, EMPTY, GRID)
    assert run.times == (120.0,)


def test_a_map_on_another_grid_is_refused():
    with pytest.raises(InputError, match='map on'):
        run_with_maps().add_map(0.0, EMPTY[1:], SMALL.grid(20, 11))


def test_a_long_run_is_thinned_and_keeps_its_first_and_last_map():
    run = run_with_maps(*(30.0 * n for n in range(MOST_MAPS + 50)))
    assert len(run.times) <= MOST_MAPS
    assert run.times[0] == 0.0
    assert run.times[-1] == 30.0 * (MOST_MAPS + 49)


def test_deviations_are_written_where_they_are_known(tmp_path):
    run = run_with_maps(0.0)
    run.rates.add_commanded(0.0, INJECTING)
    run.add_map(30.0, FULL, GRID, deviation=0.1 * FULL, systematic=0.05 * FULL)
    maps = written(run, tmp_path / 'run').maps
    np.testing.assert_array_equal(np.isnan(maps.deviation[0]), True)
    np.testing.assert_allclose(maps.deviation[1], 0.08, rtol=1e-6)
    np.testing.assert_allclose(maps.systematic[1], 0.04, rtol=1e-6)
    np.testing.assert_allclose(maps[1], 0.8, rtol=1e-6)
    plain = run_with_maps(0.0, 30.0)
    plain.rates.add_commanded(0.0, INJECTING)
    assert written(plain, tmp_path / 'plain').maps.deviation is None


def test_the_origin_of_the_maps_is_written(tmp_path):
    run = LiveRun(SMALL, GRID)
    run.rates.add_commanded(0.0, INJECTING)
    calibrated = MapOrigin(True, 'ab' * 32, 'PoroTwin 1.0')
    run.add_map(0.0, EMPTY, GRID, origin=calibrated)
    assert written(run, tmp_path / 'run').maps.origin == calibrated


def test_the_recordings_of_the_newest_diagnoses_are_kept(tmp_path):
    runs = [tmp_path / f'diagnosis_{number:02d}' / 'run' for number in range(98, 100 + KEPT_RUNS)]
    for time, run in enumerate(runs):
        run.mkdir(parents=True)
        os.utime(run, (time, time))
    own = tmp_path / 'by_hand' / 'run'
    own.mkdir(parents=True)
    forget_old_runs(tmp_path)
    assert [run.exists() for run in runs] == [False, False] + KEPT_RUNS * [True]
    assert own.exists()
    assert runs[0].parent.exists()
