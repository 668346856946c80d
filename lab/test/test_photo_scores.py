"""The score of maps against their truth, and of a whole composed case."""

import numpy as np
import pytest
from photo_examples import small_rig, textured_baseline

from lab.photographs import photo_cases
from lab.photographs.known_injection import fit_of_injection
from lab.photographs.photo_cases import draw_case, write_case
from lab.photographs.photo_scores import (
    MapScore,
    PhotoCaseScore,
    compared,
    score_case,
)
from porotwin_imaging.calibrating.calibration_trust import CalibrationRefused

TRUTH = np.linspace(0, 1, 4000).reshape(40, 100)


def test_maps_that_equal_their_truth_are_accurate_and_unbiased() -> None:
    score = compared([TRUTH], [TRUTH])
    assert score.accurate
    assert score.median == score.worst == 0
    assert all(value == 0 for value in score.bias.values())


def test_a_bias_is_found_in_its_own_zone() -> None:
    zone = (TRUTH >= 0.2) & (TRUTH < 0.5)
    score = compared([TRUTH + 0.05 * zone], [TRUTH])
    assert score.bias['low'] == pytest.approx(0.05)
    assert score.bias['high'] == score.bias['stock'] == 0
    assert not score.accurate


def test_the_worst_frame_and_the_median_count() -> None:
    frames = [1.01 * TRUTH] * 4 + [1.1 * TRUTH]
    score = compared(frames, [TRUTH] * 5)
    assert score.median == pytest.approx(0.01)
    assert score.worst == pytest.approx(0.1)
    assert not score.accurate


def test_hidden_cells_and_frames_without_tracer_do_not_count() -> None:
    hidden = np.where(TRUTH > 0.5, np.nan, TRUTH)
    score = compared([hidden, np.zeros_like(TRUTH)], [TRUTH, np.zeros_like(TRUTH)])
    assert score.errors == (0.0,)
    assert np.isnan(score.bias['stock'])


def test_a_case_is_safe_if_its_maps_are_accurate_or_it_is_refused() -> None:
    wrong = MapScore((0.2,), {})
    assert not PhotoCaseScore('a', 'none', 'use', '', wrong).safe
    refused = PhotoCaseScore('a', 'log x3', 'refuse', 'the pump log', None)
    assert refused.safe
    assert refused.row['answer'] == 'refused'
    used = PhotoCaseScore('a', 'none', 'use', '', compared([TRUTH], [TRUTH]))
    assert refused.row.keys() == used.row.keys()


@pytest.fixture
def small(monkeypatch) -> None:
    monkeypatch.setattr(photo_cases, 'TRUTH_GRID', (88, 54))
    monkeypatch.setattr(photo_cases, 'RECORDED', 2)


@pytest.mark.slow
def test_a_small_case_is_scored_and_its_wrong_pump_log_refused(small, tmp_path) -> None:
    case = draw_case(small_rig(), 1, 1, 'none')
    score = score_case(write_case(case, textured_baseline(), tmp_path / 'good'))
    assert score.maps is not None, score.refusal
    assert score.maps.median < 0.15
    wrong = draw_case(small_rig(), 1, 1, 'log x3')
    folder = write_case(wrong, textured_baseline(), tmp_path / 'wrong')
    with pytest.raises(CalibrationRefused, match='more tracer than the plume'):
        fit_of_injection(folder.with_name('c001_cal'))
