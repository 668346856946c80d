import dataclasses

import numpy as np
import pytest
import torch

from porotwin_core.errors import InputError
from porotwin_core.rig import rig_from_maps
from porotwin_costa.architectures import training_settings
from porotwin_costa.dataset import build_dataset, join_datasets
from porotwin_costa.evaluation import evaluate
from porotwin_costa.network import COMPLEX_RIG, HOMOGENEOUS_RIG, NetworkSettings
from porotwin_costa.training import (
    TrainingCancelledError,
    TrainingSettings,
    split_samples,
    train,
)

LOCAL = TrainingSettings(
    network=NetworkSettings(architecture='local'),
    epochs=40,
    batch_size=4,
    learning_rate=5e-3,
    patience=40,
)
PAPER = TrainingSettings(
    network=NetworkSettings(convolution_pool_layers=3, dense_layers=2, filters=8),
    epochs=250,
    batch_size=8,
    patience=250,
)


@pytest.fixture(scope='module')
def dataset(rig, grid, model, training_frames):
    return build_dataset(
        training_frames,
        rig,
        grid=grid,
        time_step=30.0,
        predict=model.predict,
        residual=model.residual,
    )


def _same_weights(first, second):
    ours, theirs = (model.network.state_dict() for model in (first, second))
    return all(torch.equal(ours[name], theirs[name]) for name in ours)


@pytest.mark.parametrize('settings', [LOCAL, dataclasses.replace(LOCAL, window=16), PAPER])
def test_same_seed_gives_the_same_weights_bit_for_bit(dataset, settings):
    short = dataclasses.replace(settings, epochs=3)
    first = train(dataset, short, seed=13)
    assert _same_weights(first, train(dataset, short, seed=13))
    assert not _same_weights(first, train(dataset, short, seed=14))


def test_training_does_not_touch_the_global_random_state(dataset):
    torch.manual_seed(99)
    before = torch.get_rng_state()
    train(dataset, dataclasses.replace(LOCAL, epochs=1), seed=13)
    assert torch.equal(before, torch.get_rng_state())


def test_local_network_reduces_the_error_of_an_unseen_schedule(
    dataset, rig, grid, model, judging_frames, unseen_frames
):
    judging = build_dataset(
        [judging_frames],
        rig,
        grid=grid,
        time_step=30.0,
        predict=model.predict,
        residual=model.residual,
    )
    corrective = train(join_datasets([dataset, judging]), LOCAL, seed=13)
    result = evaluate(
        [unseen_frames],
        time_step=30.0,
        predict=model.predict,
        correct=model.correct,
        assess=corrective.assess,
    )
    assert all(frame.status == 'applied' for frame in result.frames)
    assert result.mean('corrected') < 0.7 * result.mean('predicted')
    assert result.mean('free_corrected') < 0.6 * result.mean('free_predicted')
    defects = [abs(f.corrected_mass - f.predicted_mass) for f in result.frames]
    assert max(defects) < 1e-6


def test_paper_network_learns_the_frames_it_is_shown(dataset):
    shown = dataset.select(dataset.experiment == 0)
    corrective = train(shown, PAPER, seed=13)
    assert corrective.provenance['training_loss'] < 0.5


def test_a_network_that_learned_nothing_of_use_says_nothing(dataset, rig):
    noise = np.random.default_rng(17).normal(0, 1e-3, dataset.residual.shape).astype(np.float32)
    # what is kept aside is the negative of what is learned from: trusting it would do harm
    aside = split_samples(dataset, PAPER)
    noise[:] = noise[0]
    noise[aside] *= -1
    corrective = train(
        dataclasses.replace(dataset, residual=noise),
        dataclasses.replace(PAPER, epochs=20),
        seed=13,
    )
    assert corrective.trust == 0.0
    answer = corrective.assess(dataset.predicted[3].astype(float), {})
    assert not answer.applied
    assert not answer.sigma.any()


def test_a_rig_of_uneven_depth_is_told_to_the_local_network(rig, grid, model, training_frames):
    depth = np.linspace(0.008, 0.0128, 30) * np.ones((20, 1))
    uneven = rig_from_maps(
        rig.model_dump(exclude={'depth_m', 'porosity'}), {'depth_m': depth, 'porosity': 0.375}
    )
    uneven_data = build_dataset(
        training_frames,
        uneven,
        grid=grid,
        time_step=30.0,
        predict=model.predict,
        residual=model.residual,
    )
    corrective = train(uneven_data, dataclasses.replace(LOCAL, epochs=2), seed=13)
    corrective = dataclasses.replace(corrective, trust=1.0)
    sigma = corrective.corrective_source(uneven_data.predicted[20].astype(float), {})
    assert np.abs(sigma).sum() > 0
    assert abs((sigma * depth).sum()) < 1e-6 * np.abs(sigma * depth).sum()


def test_progress_reports_every_epoch_and_an_estimate(dataset):
    seen = []
    train(dataset, dataclasses.replace(LOCAL, epochs=4), seed=13, progress=seen.append)
    assert [p.epoch for p in seen] == [1, 2, 3, 4]
    assert all(p.epochs == 4 for p in seen)
    assert seen[-1].remaining_seconds == 0.0
    assert all(p.remaining_seconds > 0 for p in seen[:-1])


def test_training_stops_when_it_no_longer_gets_better(dataset):
    seen = []
    settings = dataclasses.replace(LOCAL, learning_rate=1e-12, epochs=50, patience=3)
    train(dataset, settings, seed=13, progress=seen.append)
    assert len(seen) < 50


def test_training_can_be_cancelled_between_batches(dataset):
    answers = iter([False, False, True])
    with pytest.raises(TrainingCancelledError, match='epoch 1'):
        train(dataset, LOCAL, seed=13, cancelled=lambda: next(answers))


def test_diverging_training_is_an_error_not_a_model(dataset):
    with pytest.raises(InputError, match='diverged'):
        train(dataset, dataclasses.replace(PAPER, learning_rate=1e30, epochs=2), seed=13)


def test_samples_kept_aside_are_whole_experiments(dataset):
    aside = split_samples(dataset, LOCAL)
    assert set(dataset.experiment[aside]) == {1}
    assert set(dataset.experiment[~aside]) == {0}


def test_samples_kept_aside_of_one_experiment_are_its_last(dataset):
    one = dataset.select(dataset.experiment == 0)
    aside = split_samples(one, LOCAL)
    assert aside.sum() == round(0.15 * len(one))
    assert one.time[aside].min() > one.time[~aside].max()


@pytest.mark.parametrize(
    ('lengths', 'expected'),
    [
        ([2, 2, 2, 2], [0, 0, 0, 1]),  # a quarter, and no sequence torn apart
        ([20, 4, 1], [0, 1, 1]),  # one pair alone is too few to judge by
        ([20, 20, 3, 1], [0, 3 / 20, 1, 1]),  # more than half: the last samples of all
    ],
)
def test_sequences_kept_aside_are_many_enough_and_not_too_many(dataset, lengths, expected):
    numbers = np.repeat(np.arange(len(lengths)), lengths)
    cut = dataset.select(np.arange(len(dataset)) < len(numbers))
    aside = split_samples(dataclasses.replace(cut, experiment=numbers), LOCAL)
    shares = [aside[numbers == number].mean() for number in range(len(lengths))]
    assert shares == pytest.approx(expected)


def test_too_little_to_learn_from_is_refused(dataset):
    with pytest.raises(InputError, match='at least 4'):
        train(dataset.select(np.arange(len(dataset)) < 3), LOCAL, seed=13)


def test_networks_have_names_and_the_paper_is_the_default():
    assert training_settings() == training_settings('paper')
    assert training_settings().network == HOMOGENEOUS_RIG
    assert training_settings('paper-complex').network == COMPLEX_RIG
    assert training_settings('local', epochs=3).epochs == 3
    assert training_settings('local', epochs=3).network.architecture == 'local'
    with pytest.raises(InputError, match='paper, paper-complex, local'):
        training_settings('unknown')


@pytest.mark.parametrize(
    'wrong',
    [{'epochs': 0}, {'learning_rate': 0.0}, {'validation_share': 1.0}],
)
def test_settings_that_cannot_work_are_refused(wrong):
    with pytest.raises(InputError):
        TrainingSettings(**wrong)


def test_model_tells_what_made_it(dataset):
    made = train(dataset, dataclasses.replace(LOCAL, epochs=2), seed=13).provenance
    assert made['data'] == dataset.fingerprint
    assert made['seed'] == 13
    assert made['samples'] == len(dataset)
    assert made['sources'] == ['left', 'right']
    assert made['versions']['torch']
