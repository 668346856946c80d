"""The collector: pairs from a stream of states, rates and interruptions."""

import dataclasses

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import fill_unseen
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import KnownRates
from porotwin_core.rates.wells import WellRate
from porotwin_costa.data.collector import Collector
from porotwin_costa.data.dataset import load_dataset


@pytest.fixture
def collector(rig, grid):
    return Collector(rig, grid, 30.0, RateHistory.of(rig))


def _measure(collector, start, rates):
    collector.rates.add_known(KnownRates(start, start, rates))


def _feed(collector, model, frames, count=25, start=0.0):
    """Add `frames` from `start` [s] on, and complete every pair as a solver does."""
    pairs = []
    for n in range(count):
        time = start + float(frames.times[n])
        if n + 1 < count:
            rates = frames.schedule.mean(frames.times[n], frames.times[n + 1])
            _measure(collector, time, rates)
        pairs += collector.observed(time, frames.concentration[n], model.grid)
    pairs += collector.finished()
    for pair in pairs:
        start = collector.start_state(pair)
        predicted = model.predict(start, pair.rates, 30.0)
        following = fill_unseen(pair.following, predicted)
        residual = model.residual(start, following, pair.rates, 30.0)
        collector.complete(pair, predicted, residual)
    return pairs


@pytest.mark.parametrize('hidden_columns', [0, 9])
def test_a_live_run_gives_the_data_set_that_its_recording_gives(
    collector, model, unseen_frames, build, hidden_columns
):
    concentration = unseen_frames.concentration.copy()
    concentration[:, :, :hidden_columns] = np.nan
    frames = dataclasses.replace(unseen_frames, concentration=concentration)
    _feed(collector, model, frames)
    live = collector.take()
    assert len(live) == 24
    assert live.fingerprint == build(frames).fingerprint


@pytest.mark.parametrize('late', [True, False])
def test_no_pair_reaches_across_a_clean_state_even_if_it_comes_late(
    collector, model, unseen_frames, late
):
    _feed(collector, model, unseen_frames, 5)
    if not late:
        collector.interrupted(150.0)
    collector.observed(150.0, unseen_frames.concentration[0], model.grid)
    if late:
        collector.interrupted(150.0)
    for n in (1, 2):
        _measure(collector, 120.0 + 30 * n, {'left': WellRate(1e-7)})
        for pair in collector.observed(150.0 + 30 * n, unseen_frames.concentration[n], model.grid):
            collector.complete(pair, pair.previous, pair.previous)
    dataset = collector.take()
    assert dataset.time.tolist() == [30, 60, 90, 120, 180]
    assert dataset.experiment.tolist() == [0, 0, 0, 0, 1]
    assert collector.dropped == {'pairs across an interruption': 1}


def test_a_clock_that_jumps_back_begins_another_experiment(collector, model, unseen_frames):
    _feed(collector, model, unseen_frames, 5, start=1000.0)
    _feed(collector, model, unseen_frames, 5)
    dataset = collector.take()
    assert dataset.time.tolist() == [1030, 1060, 1090, 1120, 30, 60, 90, 120]
    assert dataset.experiment.tolist() == [0] * 4 + [1] * 4


def test_pairs_are_returned_only_when_their_rates_have_arrived(collector, model, grid):
    blank = np.zeros(grid.shape)
    assert collector.observed(0.0, blank, grid) == []
    assert collector.observed(30.0, blank, grid) == []
    _measure(collector, 0.0, {'left': WellRate(1e-7, 1.0)})
    (pair,) = collector.observed(60.0, blank, grid)
    assert pair.rates['left'] == WellRate(1e-7, 1.0)
    assert pair.end == 30.0


def test_pairs_that_cannot_be_used_are_counted(collector, model, grid):
    blank, unknown = np.zeros(grid.shape), np.full(grid.shape, np.nan)
    collector.observed(0.0, blank, grid)
    collector.observed(30.0, blank, grid)
    assert collector.finished() == []
    _measure(collector, 30.0, {'left': WellRate(1e-7)})
    for time, state in ((60.0, unknown), (120.0, blank)):
        collector.observed(time, state, grid)
    assert collector.finished() == []
    assert collector.dropped == {
        'pairs without known rates': 1,
        'pairs with too little seen': 1,
        'pairs not 30 s apart': 1,
    }


def test_samples_are_taken_once_and_written_as_parts(collector, model, unseen_frames, tmp_path):
    _feed(collector, model, unseen_frames, 6)
    collector.take().append_to(tmp_path)
    assert collector.waiting == 0
    assert len(collector.take()) == 0
    _feed(collector, model, unseen_frames, 6)
    collector.take().append_to(tmp_path)
    assert len(load_dataset(tmp_path)) == 10
    assert collector.completed == 10


def test_state_on_another_grid_is_refused(collector, rig):
    with pytest.raises(InputError, match='7x5'):
        collector.observed(0.0, np.zeros((5, 7)), rig.grid(7, 5))


def test_predictions_fill_no_cells_after_the_clock_jumped_back(
    collector, model, unseen_frames, grid
):
    hidden = unseen_frames.concentration.copy()
    hidden[:, :, :9] = np.nan
    frames = dataclasses.replace(unseen_frames, concentration=hidden)
    pairs = _feed(collector, model, frames, 5)
    assert collector.start_state(pairs[-1])[:, :9].any()
    (later, *_) = _feed(collector, model, frames, 5)
    assert later.sequence == pairs[-1].sequence + 1
    assert (
        collector.start_state(pairs[-1])[:, :9].any() != collector.start_state(later)[:, :9].any()
    )


def test_report_names_the_reasons_for_pairs_left_out(collector, grid):
    unknown = np.full(grid.shape, np.nan)
    reports = []
    for number in range(4):
        collector.observed(30.0 * number, unknown, grid)
        reports.append(collector.report)
    assert reports[2:] == [
        f'0 training pairs so far; left out: {count} pairs with too little seen' for count in (1, 2)
    ]


def test_values_that_are_not_finite_make_no_sample(collector, model, unseen_frames):
    (pair, *_) = _feed(collector, model, unseen_frames, 3)
    unknown = np.full(model.grid.shape, np.nan)
    assert collector.complete(pair, pair.previous, pair.previous)
    completed = collector.completed
    assert not collector.complete(pair, unknown, pair.previous)
    assert collector.completed == completed
    assert collector.dropped == {'pairs without finite residual': 1}
