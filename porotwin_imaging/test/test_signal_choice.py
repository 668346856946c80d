"""The choice of the contrast and of the weights of red, green and blue."""

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_imaging.calibrating.signal_choice import choose_signal

LABELS = np.zeros((60, 100), np.uint8)
VISIBLE = np.ones(LABELS.shape, bool)


def concentration() -> np.ndarray:
    z, x = np.mgrid[0:60, 0:100]
    return 0.5 * (1 - np.tanh((np.hypot(x - 50, z - 30) - 18) / 4.0))


def noisy(log_ratio: np.ndarray) -> np.ndarray:
    return log_ratio + np.random.default_rng(2).normal(0, 0.01, log_ratio.shape)


def test_a_dye_that_absorbs_is_read_in_absorbance() -> None:
    log_ratio = noisy(-concentration()[..., None] * [1.9, 1.3, 1.8])
    choice = choose_signal([log_ratio], [VISIBLE], LABELS)
    assert choice.signal.contrast == 'absorbance'
    assert choice.colour_bend['absorbance'] < choice.colour_bend['difference']


def test_a_dye_whose_light_falls_straight_is_read_as_difference() -> None:
    log_ratio = noisy(np.log(1 - concentration()[..., None] * [0.73, 0.38, 0.58]))
    assert choose_signal([log_ratio], [VISIBLE], LABELS).signal.contrast == 'difference'


def test_a_person_may_choose() -> None:
    log_ratio = noisy(-concentration()[..., None] * [1.9, 1.3, 1.8])
    choice = choose_signal([log_ratio], [VISIBLE], LABELS, 'difference')
    assert choice.signal.contrast == 'difference'
    assert 'as asked' in choice.line


def test_photographs_without_tracer_are_refused() -> None:
    with pytest.raises(InputError, match='no photograph shows tracer'):
        choose_signal([noisy(np.zeros((60, 100, 3)))], [VISIBLE], LABELS)
