"""The bench measures every stage of every grid."""

import pytest

from lab.benches import bench_imaging


@pytest.mark.slow
def test_every_stage_has_a_row() -> None:
    grids = {name: bench_imaging.GRIDS[name] for name in ('280x150',)}
    rows = bench_imaging.run(camera=(900, 900), rounds=1, grids=grids)
    assert {row['grid'] for row in rows} == set(grids)
    assert {row['stage'] for row in rows} >= {'decode', 'align', 'denoise', 'whole'}
    *stages, _ = rows  # the last is a peer, with a mean at most
    assert all(row['longest_s'] >= row['median_s'] >= 0.0 for row in stages)
    assert 0.0 < stages[-1]['error'] < 0.1
