"""The figures of COSTA."""

import pytest
from large_elements import large_elements

from lab.benches import bench_costa

__all__ = ['large_elements']


@pytest.mark.slow
def test_costa_can_be_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_costa, 'GRID', (47, 28))
    (row,) = bench_costa.run(minutes=1.0, epochs=2, presets=('upwind',))
    assert 0.0 < row['with COSTA'] <= 1.5 * row['one step']
