"""The table of calibrations on composed photographs."""

import pytest

from porotwin_core.errors import InputError
from porotwin_validation import calibration_bench
from porotwin_validation.photo_scores import MapScore, PhotoCaseScore

GOOD = MapScore((0.02, 0.03), {'pale': 0.0, 'low': 0.0, 'high': 0.0, 'stock': 0.0})
BAD = MapScore((0.2, 0.3), {'pale': 0.1, 'low': 0.0, 'high': 0.0, 'stock': 0.0})


def test_the_last_row_counts_safe_cases_and_good_ones_that_were_refused(
    monkeypatch, tmp_path
) -> None:
    scores = [
        PhotoCaseScore('c000', 'none', 'use', '', GOOD),
        PhotoCaseScore('c001', 'none', 'use', 'too strict', None),
        PhotoCaseScore('c002', 'log x3', 'refuse', '', BAD),
    ]
    monkeypatch.setattr(calibration_bench, '_scores', lambda *_: iter(scores))
    rows = calibration_bench.run(tmp_path)
    assert [row['answer'] for row in rows[:3]] == ['used', 'refused', 'used']
    assert rows[-1]['safe'] == '2 of 3'
    assert rows[-1]['answer'] == '1 of 2 good ones refused'
    assert all(row.keys() == rows[0].keys() for row in rows)


def test_a_bench_without_a_baseline_says_what_it_needs() -> None:
    with pytest.raises(InputError, match='--baseline FOLDER'):
        calibration_bench.run()
