"""The bench measures every stage of every grid."""

import pytest

from porotwin_imaging import imaging_bench


@pytest.mark.slow
def test_every_stage_has_a_row() -> None:
    grids = {name: imaging_bench.GRIDS[name] for name in ('280x150',)}
    rows = imaging_bench.run(camera=(1400, 1100), rounds=1, grids=grids)
    assert {row['grid'] for row in rows} == set(grids)
    assert {row['stage'] for row in rows} >= {'decode', 'align', 'denoise', 'whole'}
    assert all(row['longest_s'] >= row['median_s'] >= 0.0 for row in rows)
