"""The bench measures every stage on both grids."""

import pytest

from porotwin_imaging import imaging_bench


@pytest.mark.slow
def test_every_stage_has_a_row() -> None:
    rows = imaging_bench.run(camera=(2000, 1400), rounds=1)
    assert {row['grid'] for row in rows} == set(imaging_bench.GRIDS)
    assert {row['stage'] for row in rows} >= {'decode', 'align', 'denoise', 'whole'}
    assert all(row['longest_s'] >= row['median_s'] >= 0.0 for row in rows)
