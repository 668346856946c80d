"""Log-odds and confidences: their limits, and their direction."""

import pytest

from porotwin_diagnosis.decision.confidence import (
    calibration_log_odds,
    confidence,
    missing_log_odds,
    no_gap_log_odds,
    sufficient_log_odds,
)


def test_a_confidence_is_the_logistic_of_the_stated_log_odds():
    """No map is fitted: even odds are 1/2, and odds of 9 to 1 are 0.9."""
    assert confidence(0.0) == 0.5
    assert confidence(2.1972245773362196) == pytest.approx(0.9)
    assert confidence(-2.1972245773362196) == pytest.approx(0.1)


def test_no_confidence_is_certain():
    assert (confidence(-50.0), confidence(50.0)) == (0.05, 0.99)


def test_a_smaller_misfit_is_more_certain():
    assert no_gap_log_odds(0.2) > no_gap_log_odds(0.4) > 0.0
    assert sufficient_log_odds(0.3) > sufficient_log_odds(0.6) > sufficient_log_odds(0.8)
    assert sufficient_log_odds(0.8) == sufficient_log_odds(1.0)
    assert 0.0 == sufficient_log_odds(0.6, shared_errors=True) < sufficient_log_odds(0.6)
    assert missing_log_odds(2.0) > missing_log_odds(1.1) > missing_log_odds(1.0) == 0.0


def test_what_the_calibration_swallows_counts_by_its_own_size_and_beside_the_effects():
    assert calibration_log_odds(0.1, 0.0) > calibration_log_odds(0.4, 0.0) > 0.0
    assert calibration_log_odds(1.0, 0.0) == 0.0
    assert calibration_log_odds(1.0, 2.0) > calibration_log_odds(1.0, 1.2) > 0.0
