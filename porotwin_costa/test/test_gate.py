"""The safety gate."""

import numpy as np
import pytest

from porotwin_costa.correction.gate import TrainingRange

WELLS = ('a', 'b')


@pytest.fixture
def trained_on():
    rng = np.random.default_rng(5)
    predicted = rng.uniform(0.0, 1.0, (6, 4, 5))
    rates = np.zeros((6, 2, 2))
    rates[:, 0] = np.linspace(1e-7, 2e-7, 6)[:, None]
    rates[:, 1, 0] = -rates[:, 0, 0]
    return TrainingRange.of(predicted, rates, np.full((6, 4, 5), -1e-4))


def _rates(water):
    return np.array([[water, water], [-water, 0.0]])


def test_values_within_the_training_are_accepted(trained_on):
    predicted = np.full((4, 5), 0.5)
    for whole_field in (True, False):
        objection = trained_on.objection(predicted, _rates(1.5e-7), WELLS, whole_field=whole_field)
        assert objection == ''


def test_a_network_that_reads_the_whole_map_is_bound_by_each_well(trained_on):
    predicted, weak = np.full((4, 5), 0.5), _rates(0.5e-7)
    objection = trained_on.objection(predicted, weak, WELLS, whole_field=True)
    assert objection.startswith("rate of 'a' [ml/h] 180 outside the trained 360 to 720")
    assert trained_on.objection(predicted, weak, WELLS, whole_field=False) == ''
    strong = trained_on.objection(predicted, _rates(3e-7), WELLS, whole_field=False)
    assert strong.startswith('pumping [ml/h] 2160 outside the trained 0 to 1440')


def test_mean_concentration_binds_only_the_whole_map(trained_on):
    predicted = np.zeros((4, 5))
    predicted[0, 0] = 0.9
    objection = trained_on.objection(predicted, _rates(1.5e-7), WELLS, whole_field=True)
    assert objection.startswith('mean concentration')
    assert trained_on.objection(predicted, _rates(1.5e-7), WELLS, whole_field=False) == ''


def test_sigma_is_bound_by_the_largest_residual(trained_on):
    assert trained_on.objection_to(np.array([[1.4e-4, -1.4e-4]])) == ''
    assert 'exceeds the plausible 0.00015' in trained_on.objection_to(np.array([[1.6e-4]]))
    assert 'not finite' in trained_on.objection_to(np.array([[np.nan]]))
