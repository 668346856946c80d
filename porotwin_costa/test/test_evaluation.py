import csv
import dataclasses

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_costa.evaluation import evaluate, relative_error
from porotwin_costa.evaluation_pictures import write_pictures
from porotwin_costa.model import APPLIED, NO_MODEL, Correction

TIME_STEP = 30.0


def _nothing(predicted, rates):
    return Correction(np.zeros_like(predicted), NO_MODEL)


def _run(model, frames, assess, **options):
    return evaluate(
        frames,
        time_step=TIME_STEP,
        predict=model.predict,
        correct=model.correct,
        assess=assess,
        **options,
    )


class _AllKnowing:
    """Answers with the exact residual of the frame that is asked for, once per step and run."""

    def __init__(self, model, frames):
        self.model, self.frames = model, frames

    def __call__(self, predicted, rates):
        starts = self.frames.concentration[:-1]
        known = [self.model.predict(start, rates, TIME_STEP) for start in starts]
        n = int(np.argmin([np.abs(predicted - one).max() for one in known]))
        sigma = self.model.residual(starts[n], self.frames.concentration[n + 1], rates, TIME_STEP)
        return Correction(sigma, APPLIED)


def test_without_correction_both_runs_agree(model, unseen_frames):
    result = _run(model, [unseen_frames], _nothing)
    assert len(result.frames) == 24
    for frame in result.frames:
        assert frame.corrected == frame.predicted
        assert frame.free_corrected == frame.free_predicted
    assert 'no correction in 24 of 24 frames, first because: no model loaded' in result.table()


def test_exact_correction_leaves_no_error_one_step_or_free(model, unseen_frames):
    steady = dataclasses.replace(
        unseen_frames,
        times=unseen_frames.times[:10],
        concentration=unseen_frames.concentration[:10],
    )
    result = _run(model, [steady], _AllKnowing(model, steady))
    assert result.mean('predicted') > 0.01
    assert result.mean('free_predicted') > result.mean('predicted')
    assert max(frame.corrected for frame in result.frames) < 1e-12
    assert max(frame.free_corrected for frame in result.frames) < 1e-12
    assert max(abs(frame.corrected_mass) for frame in result.frames) < 1e-12


def test_an_overshooting_correction_stays_within_0_and_1_as_in_the_twin(model, unseen_frames):
    starts = []

    def predict(start, rates, time_step):
        starts.append((start.min(), start.max()))
        return model.predict(start, rates, time_step)

    def overshooting(predicted, rates):
        return Correction(np.where(predicted > 0.5, 0.01, -0.01), APPLIED)

    result = evaluate(
        [unseen_frames],
        time_step=TIME_STEP,
        predict=predict,
        correct=model.correct,
        assess=overshooting,
    )
    low, high = np.transpose(starts)
    assert low.min() >= 0.0
    assert high.max() <= 1.0 + 1e-9
    assert all(shot.corrected.max() <= 1.0 for shot in result.snapshots)


def test_free_run_starts_anew_after_an_interruption(model, unseen_frames):
    interrupted = dataclasses.replace(unseen_frames, clean_times=(360.0,))
    result = _run(model, [interrupted], _nothing)
    assert [frame.time for frame in result.frames if frame.time == 360.0] == []
    after = next(frame for frame in result.frames if frame.time == 390.0)
    assert after.free_predicted == after.predicted
    before = next(frame for frame in result.frames if frame.time == 330.0)
    assert before.free_predicted > before.predicted


def test_cells_that_were_not_observed_do_not_count(model, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[24, :, :3] = np.nan
    result = _run(
        model, [dataclasses.replace(unseen_frames, concentration=concentration)], _nothing
    )
    assert len(result.frames) == 24
    assert np.isfinite(result.frames[-1].predicted)


def test_sand_that_is_never_seen_does_not_end_the_judgement(model, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[:, 4:12, 6:9] = np.nan
    hidden = dataclasses.replace(unseen_frames, concentration=concentration)
    result, whole = (_run(model, [frames], _nothing) for frames in (hidden, unseen_frames))
    assert len(result.frames) == 24
    assert result.frames[-1].free_predicted > result.frames[-1].predicted
    assert result.mean('predicted') < 1.5 * whole.mean('predicted')


def test_error_is_relative_to_the_observed_tracer():
    observed = np.array([[3.0, 4.0, np.nan]])
    assert relative_error(np.array([[3.0, 3.0, 99.0]]), observed) == pytest.approx(1 / 5)
    assert relative_error(np.array([[0.5]]), np.zeros((1, 1))) == pytest.approx(0.5)


def test_recording_without_pairs_is_refused(model, unseen_frames):
    sparse = dataclasses.replace(unseen_frames, times=unseen_frames.times * 10)
    with pytest.raises(InputError, match='no two known frames 30 s apart'):
        _run(model, [sparse], _nothing)


def test_table_and_pictures_are_written(model, unseen_frames, grid, tmp_path):
    result = _run(model, [unseen_frames], _nothing, snapshot_times=(600.0,))
    files = write_pictures(result, grid, tmp_path / 'report')
    names = {file.name for file in files}
    assert names == {'one_step.png', 'accumulated.png', 'fields_unseen_600s.png'}
    assert all(file.read_bytes().startswith(b'\x89PNG') for file in files)
    result.write_csv(tmp_path / 'errors.csv')
    with (tmp_path / 'errors.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row['predicted']) for row in rows] == [f.predicted for f in result.frames]
