"""The coarse grid of plans and siblings."""

from pathlib import Path

import pytest

from porotwin_core.rig import load_rig
from porotwin_core.rig.coarse_grid import COARSE_CELLS, coarse_grid

RIGS = Path(__file__).resolve().parents[2] / 'rigs'


@pytest.mark.parametrize('name', ['small', 'large'])
def test_rigs_of_all_sizes_have_as_many_cells(name: str) -> None:
    rig = load_rig(RIGS / name)
    grid = coarse_grid(rig, rig.default_grid(0.001))
    assert grid.nx * grid.nz == pytest.approx(COARSE_CELLS, rel=0.05)
    assert grid.dx == pytest.approx(grid.dz, rel=0.05)


def test_it_is_never_finer_than_the_maps() -> None:
    rig = load_rig(RIGS / 'small')
    assert coarse_grid(rig, rig.grid(20, 12)) == rig.grid(20, 12)
