"""The figures of COSTA."""

import pytest

from lab.benches import bench_costa


@pytest.mark.slow
def test_costa_can_be_measured() -> None:
    (row,) = bench_costa.run(minutes=1.0, epochs=2, presets=('upwind',))
    assert 0.0 < row['with COSTA'] <= 1.5 * row['one step']
