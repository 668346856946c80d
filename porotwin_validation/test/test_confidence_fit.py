"""Stated confidence against what came true."""

import json

import numpy as np
import pytest

from porotwin_validation.confidence_fit import recalibrate_from, recalibrated


def test_honest_confidences_stay_and_boastful_ones_are_lowered():
    generator = np.random.default_rng(8)
    stated = generator.uniform(0.55, 0.98, 2000)
    honest = generator.random(2000) < stated
    scale, shift = recalibrated(stated, honest)
    assert scale == pytest.approx(1.0, abs=0.15)
    assert shift == pytest.approx(0.0, abs=0.15)
    boastful = generator.random(2000) < 0.5 + 0.5 * (stated - 0.5)
    assert recalibrated(stated, boastful)[0] < 0.8


def test_a_few_lucky_cases_prove_little():
    scale, shift = recalibrated([0.9] * 4, [True] * 4)
    assert scale < 1.2
    assert shift < 0.3


def test_the_map_is_refitted_from_a_blind_check(tmp_path):
    scores = {'cases': [{'confidence': 0.95, 'right': n % 2 == 0} for n in range(40)]}
    (tmp_path / 'scores.json').write_text(json.dumps(scores))
    content = {'made_from': '', 'thresholds': {'scale': 1.0, 'shift': 0.0}}
    (tmp_path / 'calibration.json').write_text(json.dumps(content))
    scale, shift = recalibrate_from([tmp_path / 'scores.json'], tmp_path / 'calibration.json')
    odds = np.log(0.95 / 0.05)
    assert 1 / (1 + np.exp(-(scale * odds + shift))) == pytest.approx(0.5, abs=0.1)
