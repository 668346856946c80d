"""A correction: applied within 0..1, or not at all."""

import numpy as np

from porotwin_core.model.correction import Correction


def test_without_sigma_the_prediction_stays_as_it_is():
    predicted = np.array([[0.2, 1.5]])
    correction = Correction(None, 'no model loaded')
    assert not correction.applied
    assert correction.applied_to(predicted, lambda sigma: sigma) is predicted


def test_a_correction_may_overshoot_but_a_concentration_cannot():
    correction = Correction(np.array([[-0.5, 0.25, 2.0]]), 'applied')
    assert correction.applied
    corrected = correction.applied_to(np.zeros((1, 3)), lambda sigma: sigma)
    assert corrected.tolist() == [[0.0, 0.25, 1.0]]
