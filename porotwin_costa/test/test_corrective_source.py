"""The corrective source term: from the network, and withheld where it cannot be trusted."""

import dataclasses

import numpy as np
import pytest
import torch
from costa_examples import question
from toy_solver import MovingTracers, delayed

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS
from porotwin_core.rates.wells import WellRate
from porotwin_costa.correction.corrective_source import (
    APPLIED,
    NO_MODEL,
    LearntStep,
    corrective_source,
)
from porotwin_costa.networks import CorrectiveNetwork, architecture
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.training import train

NETWORKS = {
    'paper': architecture('paper').described(
        {'convolution_pool_layers': 2, 'convolution_layers': 1, 'filters': 4}
    ),
    'local': architecture('local').described({'filters': 4}),
}


@pytest.fixture(scope='module', params=list(NETWORKS))
def trained(request, dataset):
    settings = TrainingSettings(epochs=8, learning_rate=3e-3, patience=40)
    # these tests are about gate and files, not about learning
    return dataclasses.replace(
        train(dataset, NETWORKS[request.param], settings, seed=21), trust=0.9
    )


def test_sigma_has_the_grid_and_comes_from_the_network(trained, dataset):
    predicted, rates, time_step = question(dataset)
    answer = corrective_source(trained, predicted, rates, time_step)
    assert answer.status == APPLIED
    assert answer.sigma.shape == dataset.grid.shape
    assert answer.sigma.any()
    scaled = torch.as_tensor(trained.scaling.concentration(predicted), dtype=torch.float32)[None]
    scaled_rates = torch.as_tensor(dataset.rates[12] / trained.scaling.rate, dtype=torch.float32)
    output = trained.network(scaled, scaled_rates.reshape(1, -1)).detach()[0].numpy()
    # the fluxes of the last traces of tracer are left out; 0.9 is the trust
    whole = 0.9 * trained.scaling.sigma * output
    assert answer.sigma == pytest.approx(whole, abs=1e-4 * float(np.abs(whole).max()))


def test_sigma_of_a_plume_does_not_depend_on_the_size_of_the_window(trained, dataset):
    predicted, rates, time_step = question(dataset)
    middle = np.zeros(predicted.shape)
    middle[8:12, 12:18] = predicted.max()
    near = corrective_source(trained, middle, rates, time_step).sigma
    middle[0, 0] = middle[-1, -1] = 2e-5  # traces that make the window as large as the grid
    far = corrective_source(trained, middle, rates, time_step).sigma
    assert far == pytest.approx(near, abs=3e-3 * np.abs(near).max())


def test_the_learnt_physics_is_told_with_the_sigma_that_stands_for_it(trained, dataset):
    predicted, rates, time_step = question(dataset)
    assert corrective_source(trained, predicted, rates, time_step).learnt == NO_LEARNT_PHYSICS
    learnt = delayed(1.2)
    model, step = dataclasses.replace(trained, learnt=learnt), LearntStep(learnt, MovingTracers())
    applied = corrective_source(model, predicted, rates, time_step, predicted, physics=step)
    assert applied.learnt == learnt
    withheld = corrective_source(model, predicted, rates, 300.0, predicted, physics=step)
    assert withheld.learnt == NO_LEARNT_PHYSICS


def test_without_a_model_there_is_no_sigma(dataset):
    answer = corrective_source(None, *question(dataset))
    assert answer.status == NO_MODEL
    assert not answer.applied
    assert answer.sigma is None


def _withheld(answer, reason):
    assert not answer.applied
    assert answer.status.startswith('withheld: ')
    assert reason in answer.status
    assert '\n' not in answer.status
    assert answer.sigma is None
    return True


def test_another_time_step_is_withheld(trained, dataset):
    predicted, rates, _ = question(dataset)
    assert corrective_source(trained, predicted, rates, 30.2).applied
    answer = corrective_source(trained, predicted, rates, 300.0)
    assert _withheld(answer, 'trained for 30 s')


def test_pumping_beyond_the_training_is_withheld(trained, dataset):
    predicted, rates, time_step = question(dataset)
    stronger = {n: WellRate(3 * r.rate, r.concentration) for n, r in rates.items()}
    answer = corrective_source(trained, predicted, stronger, time_step)
    assert _withheld(answer, 'outside the trained')


def test_concentration_beyond_the_training_is_withheld(trained, dataset):
    predicted, rates, time_step = question(dataset)
    answer = corrective_source(trained, predicted + 0.5, rates, time_step)
    assert _withheld(answer, 'concentration')


def test_unknown_cells_are_withheld(trained, dataset):
    predicted, rates, time_step = question(dataset)
    predicted[4, 5] = np.nan
    assert _withheld(corrective_source(trained, predicted, rates, time_step), 'unknown cells')


def test_paper_network_does_not_answer_for_a_well_that_never_pumped_in_training(dataset):
    only_left = dataset.select(dataset.experiment == 0)
    settings = TrainingSettings(epochs=2, patience=40)
    trained = dataclasses.replace(train(only_left, NETWORKS['paper'], settings, seed=21), trust=1.0)
    predicted, _, time_step = question(dataset)
    rate = from_ml_h(400.0)
    rates = {'right': WellRate(rate, 1.0), 'producer': WellRate(-rate)}
    answer = corrective_source(trained, predicted, rates, time_step)
    assert _withheld(answer, "rate of 'left'")


def test_a_model_without_trust_is_withheld(trained, dataset):
    useless = dataclasses.replace(trained, trust=0.0)
    answer = corrective_source(useless, *question(dataset))
    assert _withheld(answer, 'training found nothing that holds on unseen frames')


class _Constant(CorrectiveNetwork):
    """Answers the same number everywhere."""

    def __init__(self, value):
        super().__init__()
        self.value = value

    def forward(self, concentration, rates):
        return torch.full_like(concentration, self.value)


@pytest.mark.parametrize(
    ('value', 'reason'), [(np.nan, 'not finite'), (1e4, 'exceeds the plausible')]
)
def test_implausible_answers_are_withheld(trained, dataset, value, reason):
    wrong = dataclasses.replace(trained, network=_Constant(value))
    assert _withheld(corrective_source(wrong, *question(dataset)), reason)


def test_prediction_on_another_grid_is_refused(trained):
    with pytest.raises(InputError, match='30x20'):
        corrective_source(trained, np.zeros((7, 7)), {}, 30.0)
