"""What counts as the run so far, and how it becomes a recording."""

import numpy as np
import pytest
from diagnosis_examples import SMALL

from porotwin_core.errors import InputError
from porotwin_core.wells import WellRate
from porotwin_diagnosis.data.live_run import MOST_MAPS, LiveRun
from porotwin_recording.recording import open_recording

GRID = SMALL.grid(20, 12)
EMPTY = np.zeros(GRID.shape)
FULL = np.full(GRID.shape, 0.8)
INJECTING = {'injector': WellRate(1e-7, 1.0)}


def run(*stamps, first=EMPTY):
    kept = LiveRun(SMALL, GRID)
    for number, stamp in enumerate(stamps):
        kept.saw(stamp, FULL if number else first, GRID)
    return kept


def written(kept, folder):
    kept.write(folder)
    return open_recording(folder)


def test_time_begins_with_the_run_whatever_the_clock_of_the_photographs(tmp_path):
    kept = run(1.7e9, 1.7e9 + 30.0, 1.7e9 + 60.0)
    kept.pumped(1.7e9 + 30.0, 1.7e9 + 60.0, INJECTING)
    recording = written(kept, tmp_path / 'run')
    assert recording.times == pytest.approx([0.0, 30.0, 60.0])
    assert recording.schedule.at(29.0) == {}
    assert recording.schedule.at(30.0) == INJECTING


def test_missed_photographs_do_not_end_a_run():
    assert len(run(0.0, 30.0, 600.0)) == 3


def test_a_clock_that_goes_back_begins_a_run_in_which_the_pumps_go_on(tmp_path):
    kept = run(0.0, 30.0)
    kept.pumped(10.0, 10.0, INJECTING)
    kept.saw(5.0, EMPTY, GRID)
    recording = written(kept, tmp_path / 'run')
    assert list(recording.times) == [0.0]
    assert recording.schedule.at(0.0) == INJECTING


def test_a_finished_run_stays_until_another_begins():
    kept = run(0.0, 30.0)
    kept.finished()
    assert len(kept) == 2
    kept.saw(900.0, EMPTY, GRID)
    assert len(kept) == 1


def test_a_run_that_was_not_seen_from_its_beginning_is_refused(tmp_path):
    for since in (3000.0, 2970.0):  # its rates are heard with the first map, or just before it
        kept = run(3000.0, 3030.0, first=FULL)
        kept.pumped(since, 3000.0, INJECTING)
        with pytest.raises(InputError, match='nobody saw how it got there'):
            kept.write(tmp_path / 'run')
    kept = run(30000.0, 30030.0, first=FULL)
    kept.pumped(0.0, 30000.0, INJECTING)  # it was seen how
    kept.write(tmp_path / 'run')


def test_a_run_whose_rates_nobody_told_is_refused(tmp_path):
    with pytest.raises(InputError, match='nobody said what the pumps do'):
        run(0.0, 30.0).write(tmp_path / 'run')


def test_a_setpoint_counts_as_followed_unless_rates_were_measured_since(tmp_path):
    other = {'injector': WellRate(5e-8, 1.0)}
    kept = run(0.0, 30.0, 60.0, 90.0)
    kept.told(0.0, INJECTING)
    kept.told(30.0, INJECTING)
    kept.pumped(30.0, 60.0, other)
    kept.told(30.0, INJECTING)  # comes late
    kept.told(60.0, INJECTING)
    schedule = written(kept, tmp_path / 'run').schedule
    assert [schedule.at(t)['injector'].rate for t in (0.0, 29.0, 30.0, 59.0, 60.0)] == [
        1e-7, 1e-7, 5e-8, 5e-8, 1e-7
    ]  # fmt: skip


def test_a_new_start_begins_a_run_where_the_tracer_is_gone():
    kept = run(0.0, 30.0, 60.0)
    kept.started()
    kept.saw(90.0, FULL, GRID)  # only the evaluation of photographs was started again
    assert len(kept) == 4
    kept.started()
    kept.saw(120.0, EMPTY, GRID)
    assert len(kept) == 1


def test_a_map_on_another_grid_is_refused():
    with pytest.raises(InputError, match='map on'):
        run().saw(0.0, EMPTY[1:], SMALL.grid(20, 11))


def test_a_long_run_is_thinned_and_keeps_its_ends():
    kept = run(*(30.0 * n for n in range(MOST_MAPS + 50)))
    assert len(kept) <= MOST_MAPS
    assert kept._times[0] == 0.0
    assert kept._times[-1] == 30.0 * (MOST_MAPS + 49)
