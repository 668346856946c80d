"""From frames to training data: predictions, residuals, unseen cells and pairs left out."""

import dataclasses

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError


def test_exact_residual_returns_the_observed_state(build, model, unseen_frames):
    dataset = build(unseen_frames)
    for n in range(len(dataset)):
        rates = unseen_frames.schedule.mean(n * 30.0, (n + 1) * 30.0)
        corrected = model.correct(
            unseen_frames.concentration[n], dataset.residual[n].astype(float), rates, 30.0
        )
        # the data set keeps float32: relative 6e-8 of a residual of about phi / dt
        assert np.abs(corrected - unseen_frames.concentration[n + 1]).max() < 1e-6


def test_every_consecutive_pair_becomes_one_sample(build, unseen_frames):
    dataset = build(unseen_frames)
    assert len(dataset) == len(unseen_frames.times) - 1
    assert dataset.predicted.shape == dataset.residual.shape == (24, 20, 30)
    assert np.array_equal(dataset.time, unseen_frames.times[1:])
    assert 'left out' not in dataset.summary


def test_no_pair_reaches_across_a_clean_state(build, unseen_frames):
    dataset = build(dataclasses.replace(unseen_frames, clean_times=(300.0,)))
    assert 300.0 not in dataset.time
    assert len(dataset) == 23
    assert len(np.unique(dataset.experiment)) == 2
    assert '1 pairs across an interruption' in dataset.summary


def test_pairs_of_another_time_step_are_left_out_and_counted(build, unseen_frames):
    keep = np.arange(25) != 7
    frames = dataclasses.replace(
        unseen_frames,
        times=unseen_frames.times[keep],
        concentration=unseen_frames.concentration[keep],
    )
    dataset = build(frames)
    assert len(dataset) == 22
    assert '1 pairs not 30 s apart' in dataset.summary


def _hiding(frames, cells):
    """Return the frames with `cells` (nz, nx) hidden in all of them, as behind a tube."""
    concentration = np.where(cells, np.nan, frames.concentration)
    return dataclasses.replace(frames, concentration=concentration)


def test_cells_that_are_never_seen_are_filled_from_predictions(build, model, unseen_frames):
    hidden = np.zeros(model.grid.shape, bool)
    hidden[4:12, 6:9] = True  # the plume passes here
    dataset, whole = build(_hiding(unseen_frames, hidden)), build(unseen_frames)
    assert len(dataset) == len(whole)
    assert 'left out' not in dataset.summary
    assert np.isfinite(dataset.predicted).all()
    assert not dataset.residual[:, hidden].any()
    truth = whole.predicted[-1, hidden]
    assert truth.max() > 0.5
    # 24 steps of the diffusive scheme without an observation
    assert np.abs(dataset.predicted[-1, hidden] - truth).max() < 0.2
    error = np.linalg.norm(dataset.residual - whole.residual, axis=(1, 2))
    assert error[-1] < np.linalg.norm(whole.residual[-1])


def test_no_prediction_fills_cells_across_a_clean_state(build, model, unseen_frames):
    hidden = np.zeros(model.grid.shape, bool)
    hidden[4:12, 6:9] = True
    frames = dataclasses.replace(_hiding(unseen_frames, hidden), clean_times=(300.0,))
    dataset = build(frames)
    rates = frames.schedule.mean(300.0, 330.0)
    blank = np.where(hidden, 0.0, unseen_frames.concentration[10])
    after = dataset.predicted[dataset.time == 330.0][0]
    assert np.array_equal(after, model.predict(blank, rates, 30.0).astype(np.float32))


def test_frames_with_too_little_seen_are_left_out_and_counted(build, unseen_frames):
    concentration = unseen_frames.concentration.copy()
    concentration[10, :, 14:] = np.nan
    dataset = build(dataclasses.replace(unseen_frames, concentration=concentration))
    assert len(dataset) == 22
    assert np.isfinite(dataset.predicted).all()
    assert '2 pairs with too little seen' in dataset.summary


def test_a_recording_without_pairs_is_refused_with_the_reason(build, unseen_frames):
    with pytest.raises(InputError, match='24 pairs not 60 s apart'):
        build(unseen_frames, time_step=60.0)


def test_maps_on_another_grid_are_refused(build, unseen_frames):
    frames = dataclasses.replace(unseen_frames, concentration=np.zeros((25, 8, 9)))
    with pytest.raises(InputError, match=r'\(8, 9\).*30x20'):
        build(frames)
