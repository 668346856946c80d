"""Training: repeatable, validated on whole experiments, cautious, cancellable."""

import dataclasses
import functools

import numpy as np
import pytest
import torch
from costa_examples import question

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import rig_from_maps
from porotwin_costa.correction.corrective_source import corrective_source
from porotwin_costa.data.dataset import join_datasets
from porotwin_costa.evaluation.evaluation import evaluate
from porotwin_costa.networks import architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import TrainingCancelledError, split_samples, train

LOCAL = architecture('local')
LOCAL_TRAINING = TrainingSettings(epochs=15, batch_size=4, learning_rate=5e-3, patience=15)
PAPER = architecture('paper').described(
    {'convolution_pool_layers': 3, 'dense_layers': 2, 'filters': 8}
)
PAPER_TRAINING = TrainingSettings(epochs=120, batch_size=8, patience=120)
SHARE = LOCAL_TRAINING.validation_share


def _same_weights(first, second):
    ours, theirs = (model.network.state_dict() for model in (first, second))
    return all(torch.equal(ours[name], theirs[name]) for name in ours)


@pytest.mark.parametrize(
    ('network', 'settings'),
    [
        (LOCAL, LOCAL_TRAINING),
        (LOCAL, dataclasses.replace(LOCAL_TRAINING, window=16)),
        (PAPER, PAPER_TRAINING),
    ],
)
def test_same_seed_gives_the_same_weights_bit_for_bit(dataset, network, settings):
    short = settings.with_epochs(3)
    first = train(dataset, network, short, seed=13)
    assert _same_weights(first, train(dataset, network, short, seed=13))
    assert not _same_weights(first, train(dataset, network, short, seed=14))


def test_an_architecture_is_trained_as_suits_it(dataset):
    quick = dataclasses.replace(LOCAL, training=LOCAL.training.with_epochs(1))
    made = train(dataset, quick, seed=13).provenance['settings']
    assert made == {
        'network': {'architecture': 'local', 'filters': 16},
        **dataclasses.asdict(quick.training),
    }


def test_a_network_that_reads_the_whole_map_is_not_trained_on_windows(dataset):
    settings = dataclasses.replace(PAPER_TRAINING, window=16)
    with pytest.raises(InputError, match="'paper': reads the whole map"):
        train(dataset, PAPER, settings, seed=13)


def test_training_does_not_touch_the_global_random_state(dataset):
    torch.manual_seed(99)
    before = torch.get_rng_state()
    train(dataset, LOCAL, LOCAL_TRAINING.with_epochs(1), seed=13)
    assert torch.equal(before, torch.get_rng_state())


def test_local_network_reduces_the_error_of_an_unseen_schedule(
    dataset, build, model, validation_frames, unseen_frames
):
    all_pairs = join_datasets([dataset, build(validation_frames)])
    corrective = train(all_pairs, LOCAL, LOCAL_TRAINING, seed=13)
    result = evaluate(
        [unseen_frames],
        time_step=30.0,
        predict=model.predict,
        correct=model.correct,
        correction=functools.partial(corrective_source, corrective),
    )
    assert all(frame.status == 'applied' for frame in result.frames)
    assert result.mean('corrected') < 0.7 * result.mean('predicted')
    assert result.mean('free_corrected') < 0.6 * result.mean('free_predicted')
    defects = [abs(f.corrected_mass - f.predicted_mass) for f in result.frames]
    assert max(defects) < 1e-6


def test_paper_network_learns_the_frames_it_is_shown(dataset):
    shown = dataset.select(dataset.experiment == 0)
    corrective = train(shown, PAPER, PAPER_TRAINING, seed=13)
    assert corrective.provenance['training_loss'] < 0.5


def test_a_network_that_learned_nothing_of_use_is_not_trusted(dataset):
    noise = np.random.default_rng(17).normal(0, 1e-3, dataset.residual.shape).astype(np.float32)
    # the validation samples are the negative of the training samples: trust would do harm
    aside = split_samples(dataset, SHARE)
    noise[:] = noise[0]
    noise[aside] *= -1
    corrective = train(
        dataclasses.replace(dataset, residual=noise),
        PAPER,
        PAPER_TRAINING.with_epochs(20),
        seed=13,
    )
    assert corrective.trust == 0.0
    answer = corrective_source(corrective, *question(dataset, 3))
    assert not answer.applied
    assert answer.sigma is None


def test_the_local_network_knows_the_uneven_depth_of_a_rig(rig, build, training_frames):
    depth = np.linspace(0.008, 0.0128, 30) * np.ones((20, 1))
    uneven = rig_from_maps(
        rig.model_dump(exclude={'depth_m', 'porosity'}), {'depth_m': depth, 'porosity': 0.375}
    )
    uneven_data = build(*training_frames, of=uneven)
    corrective = train(uneven_data, LOCAL, LOCAL_TRAINING.with_epochs(2), seed=13)
    corrective = dataclasses.replace(corrective, trust=1.0)
    predicted = uneven_data.predicted[20].astype(float)
    sigma = corrective_source(corrective, predicted, {}, 30.0).sigma
    assert np.abs(sigma).sum() > 0
    assert abs((sigma * depth).sum()) < 1e-6 * np.abs(sigma * depth).sum()


def test_progress_reports_every_epoch_and_an_estimate(dataset):
    seen = []
    train(dataset, LOCAL, LOCAL_TRAINING.with_epochs(4), seed=13, progress=seen.append)
    assert [p.epoch for p in seen] == [1, 2, 3, 4]
    assert all(p.epochs == 4 for p in seen)
    assert seen[-1].remaining_seconds == 0.0
    assert all(p.remaining_seconds > 0 for p in seen[:-1])


def test_training_stops_when_it_no_longer_gets_better(dataset):
    seen = []
    settings = TrainingSettings(epochs=50, batch_size=4, learning_rate=1e-12, patience=3)
    train(dataset, LOCAL, settings, seed=13, progress=seen.append)
    assert len(seen) < 50


def test_training_can_be_cancelled_between_batches(dataset):
    answers = iter([False, False, True])
    with pytest.raises(TrainingCancelledError, match='epoch 1'):
        train(dataset, LOCAL, LOCAL_TRAINING, seed=13, cancelled=lambda: next(answers))


def test_diverging_training_is_an_error_not_a_model(dataset):
    settings = dataclasses.replace(PAPER_TRAINING, learning_rate=1e30, epochs=2)
    with pytest.raises(InputError, match='diverged'):
        train(dataset, PAPER, settings, seed=13)


def test_validation_samples_are_whole_experiments(dataset):
    aside = split_samples(dataset, SHARE)
    assert set(dataset.experiment[aside]) == {1}
    assert set(dataset.experiment[~aside]) == {0}


def test_validation_samples_of_one_experiment_are_its_last(dataset):
    one = dataset.select(dataset.experiment == 0)
    aside = split_samples(one, SHARE)
    assert aside.sum() == round(0.15 * len(one))
    assert one.time[aside].min() > one.time[~aside].max()


@pytest.mark.parametrize(
    ('lengths', 'expected'),
    [
        ([2, 2, 2, 2], [0, 0, 0, 1]),  # a quarter, and no sequence is split
        ([20, 4, 1], [0, 1, 1]),  # one pair alone is too few
        ([20, 20, 3, 1], [0, 3 / 20, 1, 1]),  # more than half: the last samples of all
    ],
)
def test_validation_has_enough_samples_and_at_most_half(dataset, lengths, expected):
    numbers = np.repeat(np.arange(len(lengths)), lengths)
    cut = dataset.select(np.arange(len(dataset)) < len(numbers))
    aside = split_samples(dataclasses.replace(cut, experiment=numbers), SHARE)
    shares = [aside[numbers == number].mean() for number in range(len(lengths))]
    assert shares == pytest.approx(expected)


def test_too_little_to_learn_from_is_refused(dataset):
    with pytest.raises(InputError, match='at least 4'):
        train(dataset.select(np.arange(len(dataset)) < 3), LOCAL, seed=13)


def test_model_records_its_training(dataset):
    made = train(dataset, LOCAL, LOCAL_TRAINING.with_epochs(2), seed=13).provenance
    assert made['data'] == dataset.fingerprint
    assert made['seed'] == 13
    assert made['samples'] == len(dataset)
    assert made['sources'] == ['left', 'right']
    assert made['versions']['torch']
