"""The table of calibrations on composed photographs."""

import json
from dataclasses import asdict

import pytest

from lab.benches import bench_calibration
from lab.photographs.photo_scores import MapScore, PhotoCaseScore
from porotwin_core.basis.errors import InputError

GOOD = MapScore((0.02, 0.03), {'pale': 0.0, 'low': 0.0, 'high': 0.0, 'stock': float('nan')})
BAD = MapScore((0.2, 0.3), {'pale': 0.1, 'low': 0.0, 'high': 0.0, 'stock': 0.0})
SCORES = (
    PhotoCaseScore('c000', 'none', 'use', '', GOOD),
    PhotoCaseScore('c001', 'none', 'use', 'too strict', None),
    PhotoCaseScore('c002', 'log x3', 'refuse', '', BAD, ('a line',)),
)


def test_cases_that_are_done_are_not_done_again_and_the_last_row_counts_them(tmp_path) -> None:
    for number, score in enumerate(SCORES):
        (tmp_path / f'case_7_{number:03d}.json').write_text(json.dumps(asdict(score)))
    rows = bench_calibration.run(tmp_path / 'baseline', cases=3, seed=7, output=tmp_path)
    assert [row['answer'] for row in rows[:3]] == ['used', 'refused', 'used']
    assert rows[-1]['safe'] == '2 of 3'
    assert rows[-1]['answer'] == '1 of 2 good ones refused'
    assert all(row.keys() == rows[0].keys() for row in rows)


def test_a_bench_without_a_baseline_says_what_it_needs() -> None:
    with pytest.raises(InputError, match='--baseline FOLDER'):
        bench_calibration.run()
