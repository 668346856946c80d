"""Tests of the change test: chance and one bad photograph pass, a lasting change does not."""

import numpy as np

from porotwin_diagnosis.mending.forecast_band import LEARNING, ForecastBand


def errors(count, level=0.02, seed=3):
    return level * np.exp(0.1 * np.random.default_rng(seed).standard_normal(count))


def test_chance_leaves_no_band():
    band = ForecastBand()
    assert not any(band.left_by(error) for error in errors(300))
    assert not any(band.left_by(error, 0.02) for error in errors(300))


def test_a_hand_in_one_photograph_is_no_change():
    band = ForecastBand()
    course = errors(40)
    course[20] = 5.0
    assert not any(band.left_by(error, 0.02) for error in course)


def test_a_lasting_change_is_found_within_a_few_photographs():
    for expected in (float('nan'), 0.02):
        band = ForecastBand()
        assert not any(band.left_by(error, expected) for error in errors(30))
        later = [band.left_by(error, expected) for error in errors(10, level=0.03)]
        assert later.index(True) < 5


def test_a_change_is_told_once_and_a_new_model_has_a_new_band():
    band = ForecastBand()
    for error in errors(LEARNING):
        band.left_by(error)
    assert sum(band.left_by(error) for error in errors(4, level=0.05)) == 1
    band.begin_anew()
    assert not any(band.left_by(error) for error in errors(40, level=0.05))


def test_missing_errors_do_not_count():
    band = ForecastBand()
    assert not any(band.left_by(float('nan')) for _ in range(50))


def test_infinite_errors_leave_the_band_as_very_bad_ones_do():
    band = ForecastBand()
    assert [band.left_by(float('inf')) for _ in range(3)] == [False, False, True]
