"""Errors per frame with and without the correction, one step ahead and free-running."""

import csv
import dataclasses

import numpy as np
import pytest
from costa_examples import TIME_STEP

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import relative_error
from porotwin_core.model.correction import Correction
from porotwin_core.model.held_out_share import held_out_begin
from porotwin_costa.correction.corrective_source import APPLIED, NO_MODEL, PHYSICS_ONLY
from porotwin_costa.evaluation.evaluation import evaluate


def _nothing(*_):
    return Correction(None, NO_MODEL)


def _run(model, frames, correction, **options):
    return evaluate(
        frames,
        time_step=TIME_STEP,
        predict=model.predict,
        correct=model.correct,
        correction=correction,
        **options,
    )


class _Exact:
    """Answers with the exact residual of the frame that the prediction belongs to."""

    def __init__(self, model, frames):
        self.model, self.frames = model, frames

    def __call__(self, predicted, rates, *_):
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
    assert 'not the whole correction in 24 of 24 frames; the first: no model' in result.table()


def test_the_last_30_percent_begin_where_those_of_a_diagnosis_do(model, unseen_frames):
    """The first map, which nobody predicts, did not count: 7 of 25 maps were the last 30 %."""
    result = _run(model, [unseen_frames], _nothing)
    (means,) = result.by_recording().values()
    times = unseen_frames.times
    late = result.frames[-sum(times >= held_out_begin(times[0], times[-1])) :]
    expected = np.mean([frame.free_predicted for frame in late])
    assert len(late) == 8
    assert means['free_running_last_30_percent']['model'] == pytest.approx(expected)


def test_the_table_names_the_last_two_folders_of_a_recording(model, unseen_frames):
    long = dataclasses.replace(unseen_frames, name='/data/work/clone/runs/a_night_of_experiments')
    head, line, *_ = _run(model, [long], _nothing).table().splitlines()
    assert line.startswith('runs/a_night_of_experiments     24 ')
    assert head.index('frames') + len('frames') == line.index(' 24 ') + 3


def test_exact_correction_has_no_error_one_step_ahead_or_free_running(model, unseen_frames):
    steady = dataclasses.replace(
        unseen_frames,
        times=unseen_frames.times[:10],
        concentration=unseen_frames.concentration[:10],
    )
    result = _run(model, [steady], _Exact(model, steady))
    assert result.mean('predicted') > 0.01
    assert result.mean('free_predicted') > result.mean('predicted')
    assert max(frame.corrected for frame in result.frames) < 1e-12
    assert max(frame.free_corrected for frame in result.frames) < 1e-12
    assert max(abs(frame.corrected_mass) for frame in result.frames) < 1e-12


def test_a_part_of_the_correction_is_not_told_as_none(model, unseen_frames):
    def by_physics(predicted, *_):
        return Correction(np.zeros_like(predicted), f'{PHYSICS_ONLY}pumping 900')

    told = _run(model, [unseen_frames], by_physics).table()
    assert 'no correction' not in told
    assert 'in 24 of 24 frames; the first: applied: learnt physics, without the network' in told


def test_an_overshooting_correction_stays_within_0_and_1_as_in_the_twin(model, unseen_frames):
    starts = []

    def predict(start, rates, time_step):
        starts.append((start.min(), start.max()))
        return model.predict(start, rates, time_step)

    def overshooting(predicted, *_):
        return Correction(np.where(predicted > 0.5, 0.01, -0.01), APPLIED)

    result = evaluate(
        [unseen_frames],
        time_step=TIME_STEP,
        predict=predict,
        correct=model.correct,
        correction=overshooting,
    )
    low, high = np.transpose(starts)
    assert low.min() >= 0.0
    assert high.max() <= 1.0 + 1e-9
    assert all(frame.corrected.max() <= 1.0 for frame in result.shown)


def test_free_run_starts_anew_after_an_interruption(model, unseen_frames):
    interrupted = dataclasses.replace(unseen_frames, clean_times=(360.0,))
    result = _run(model, [interrupted], _nothing)
    assert [frame.time for frame in result.frames if frame.time == 360.0] == []
    after = next(frame for frame in result.frames if frame.time == 390.0)
    assert after.free_predicted == after.predicted
    before = next(frame for frame in result.frames if frame.time == 330.0)
    assert before.free_predicted > before.predicted


def test_errors_relative_to_better_maps_leave_the_noise_of_the_observed_ones_out(
    model, unseen_frames
):
    noise = 0.05 * np.random.default_rng(3).standard_normal(unseen_frames.concentration.shape)
    noisy = dataclasses.replace(unseen_frames, concentration=unseen_frames.concentration + noise)
    seen = []
    result = _run(model, [noisy], _nothing, references=[unseen_frames], see=seen.append)
    beside_noise = _run(model, [noisy], _nothing).frames[-1].free_predicted
    assert result.frames[-1].free_predicted < beside_noise
    assert len(seen) == 24
    last = seen[-1]
    assert np.array_equal(last.observed, unseen_frames.concentration[-1])
    assert relative_error(last.free_predicted, last.observed) == result.frames[-1].free_predicted


def test_a_reference_without_a_map_of_the_time_is_refused(model, unseen_frames):
    other = dataclasses.replace(unseen_frames, times=unseen_frames.times + 7.0, name='truth.nc')
    with pytest.raises(InputError, match=r'truth.nc: has no map at 30 s'):
        _run(model, [unseen_frames], _nothing, references=[other])


def test_cells_that_were_not_observed_do_not_count(model, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[24, :, :3] = np.nan
    result = _run(
        model, [dataclasses.replace(unseen_frames, concentration=concentration)], _nothing
    )
    assert len(result.frames) == 24
    assert np.isfinite(result.frames[-1].predicted)


def test_cells_that_are_never_seen_do_not_end_the_evaluation(model, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[:, 4:12, 6:9] = np.nan
    hidden = dataclasses.replace(unseen_frames, concentration=concentration)
    result, whole = (_run(model, [frames], _nothing) for frames in (hidden, unseen_frames))
    assert len(result.frames) == 24
    assert result.frames[-1].free_predicted > result.frames[-1].predicted
    assert result.mean('predicted') < 1.5 * whole.mean('predicted')


def test_errors_are_those_of_the_grid_and_undefined_without_tracer(model, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[1] = 0.0  # the camera saw no tracer in the second frame
    frames = dataclasses.replace(unseen_frames, concentration=concentration)
    result = _run(model, [frames], _nothing, shown_times=frames.times)
    errors = [frame.predicted for frame in result.frames]
    expected = [relative_error(frame.predicted, frame.observed) for frame in result.shown]
    assert np.array_equal(errors, expected, equal_nan=True)
    assert np.isnan(errors[0])
    assert np.isfinite(errors[1:]).all()
    assert result.mean('predicted') == np.mean(errors[1:])


def test_mean_error_of_frames_without_tracer_is_undefined(model, unseen_frames):
    blank = dataclasses.replace(
        unseen_frames, concentration=np.zeros_like(unseen_frames.concentration)
    )
    assert np.isnan(_run(model, [blank], _nothing).mean('predicted'))


def test_recording_without_pairs_is_refused(model, unseen_frames):
    sparse = dataclasses.replace(unseen_frames, times=unseen_frames.times * 10)
    with pytest.raises(InputError, match=r'no two known frames 30 s apart, .* train one for'):
        _run(model, [sparse], _nothing)


def test_a_row_per_frame_is_written(model, unseen_frames, tmp_path):
    result = _run(model, [unseen_frames], _nothing)
    result.write_csv(tmp_path / 'errors.csv')
    with (tmp_path / 'errors.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row['predicted']) for row in rows] == [f.predicted for f in result.frames]
