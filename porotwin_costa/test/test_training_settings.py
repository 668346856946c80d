"""Settings of a training."""

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_costa.networks.training_settings import TrainingSettings


def test_number_of_epochs_can_be_chosen_or_kept():
    assert TrainingSettings(epochs=7, patience=40).with_epochs(3).epochs == 3
    assert TrainingSettings(epochs=7, patience=40).with_epochs(0).epochs == 7


@pytest.mark.parametrize(
    'wrong',
    [{'epochs': 0}, {'learning_rate': 0.0}, {'validation_share': 1.0}, {'window': -1}],
)
def test_settings_that_cannot_work_are_refused(wrong):
    with pytest.raises(InputError):
        TrainingSettings(**{'epochs': 1, 'patience': 1, **wrong})
