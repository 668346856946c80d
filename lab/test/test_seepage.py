"""The sand tank of 1904: every photograph is mapped, and the early ones tell the rates."""

from pathlib import Path

import pytest

from lab.photographs import seepage
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import load_rig


@pytest.mark.slow
def test_every_photograph_is_mapped_and_shows_all_plumes() -> None:
    if not (seepage.PHOTOGRAPHS / seepage.BASELINE).is_file():
        pytest.skip(f'needs the photographs in {seepage.PHOTOGRAPHS}')
    rig = load_rig(seepage.RIG)
    grid = rig.grid(65, 62)
    seen = seepage.map_photographs(rig, grid, seepage.PHOTOGRAPHS)
    assert [set(one.plumes) for one in seen[1:]] == [set('DEFG')] * 3
    rates = seepage.rates_by_growth(rig, grid, seen[: seepage.SEEN])
    assert all(20.0 < rate < 300.0 for rate in rates.values())


def test_missing_photographs_are_told_with_their_origin(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='Olsthoorn'):
        seepage.run(tmp_path, tmp_path / 'output')
