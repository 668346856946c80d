"""A well that injects tracer, but shows none in the maps, is named."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_core.checks.well_check import pale_well_remark
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate

RIG = box_rig(**{'in': (0.3, 0.2), 'other': (0.05, 0.2)})
GRID = RIG.grid(120, 80)
TIMES = [0.0, 100.0, 200.0, 300.0, 400.0]
STOCK = ScheduleRow(0.0, 'in', WellRate(1e-6, 1.0))
"""1 ml/s of stock; the cells around the well hold 5 ml."""


def _discs(level: float = 1.0, *, hole: float = 0.0) -> list[np.ndarray]:
    """Return plumes around the well at `TIMES`, with an empty middle of radius `hole` [m]."""
    distance = np.hypot(GRID.x[None, :] - 0.3, GRID.z[:, None] - 0.2)
    radii = [np.sqrt(1e-6 * time / (0.4 * 0.02 * np.pi)) for time in TIMES]
    return [np.where((distance < r) & (distance >= hole), level, 0.0) for r in radii]


def _remark(maps: list[np.ndarray], *rows: ScheduleRow) -> str:
    return pale_well_remark(maps, TIMES, RIG, Schedule(rows))


def test_a_plume_without_its_middle_is_named() -> None:
    assert _remark(_discs(), STOCK) == ''
    remark = _remark(_discs(hole=0.03), STOCK)
    assert remark.startswith('the maps show 0 % of the tracer at well in while it injects')
    assert 'the baseline shows tracer already' in remark


def test_a_dilution_and_a_narrow_stream_fill_their_well() -> None:
    assert _remark(_discs(0.3), ScheduleRow(0.0, 'in', WellRate(1e-6, 0.3))) == ''
    stream = (np.abs(GRID.z[:, None] - 0.2) < 0.006) & (GRID.x[None, :] >= 0.295)
    assert _remark([stream.astype(float)] * len(TIMES), STOCK) == ''


@pytest.mark.parametrize(
    'later',
    [WellRate(0.0, 1.0), WellRate(1e-6, 0.0), WellRate(-1e-6), WellRate(1e-9, 0.5)],
)
def test_a_well_that_does_not_inject_its_tracer_any_more_is_not_judged(later: WellRate) -> None:
    empty = _discs()[:1] * len(TIMES)
    assert _remark(empty, STOCK, ScheduleRow(1.0, 'in', later)) == ''


def test_a_plume_of_another_dye_hides_its_well() -> None:
    other_dye = [np.where(plume > 0.0, np.nan, plume) for plume in _discs()]
    assert _remark(other_dye, STOCK).startswith('the maps hide well in while it injects tracer')


def test_what_is_not_known_is_not_judged() -> None:
    hidden = [np.full(GRID.shape, np.nan)] * len(TIMES)
    assert _remark(hidden, STOCK) == ''
    assert _remark(_discs(hole=0.03)) == ''
    assert pale_well_remark([], [], RIG, Schedule((STOCK,))) == ''


def test_tracer_that_comes_late_is_no_contradiction() -> None:
    late = [_discs()[0], *_discs()[:-1]]
    assert _remark(late, STOCK) == ''


def test_only_wells_with_tracer_are_judged() -> None:
    empty = _discs()[:1] * len(TIMES)
    other = ScheduleRow(0.0, 'other', WellRate(1e-6, 1.0))
    water = ScheduleRow(0.0, 'in', WellRate(1e-6, 0.0))
    assert 'at well other' in _remark(_discs(), STOCK, other)
    assert _remark(empty, water) == ''
