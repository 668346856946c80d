"""A well that injects tracer, but shows none in the maps, is named."""

import numpy as np
import pytest
from box_rig import box_rig

from porotwin_checks.checks.tracer_at_wells import CHECK
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
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


def _codes(maps: list[np.ndarray], *rows: ScheduleRow) -> list[str]:
    return [remark.code for remark in _found(maps, *rows)]


def _found(maps: list[np.ndarray], *rows: ScheduleRow) -> list[Remark]:
    known = Known(rig=RIG, pumped=Schedule(rows), times=TIMES, maps=maps, scaled_maps=maps)
    return list(CHECK.find(known)) if known.has('rates') else []


def test_a_plume_without_its_middle_is_named() -> None:
    assert _codes(_discs(), STOCK) == []
    (remark,) = _found(_discs(hole=0.03), STOCK)
    assert (remark.code, remark.facts['well'], remark.facts['share']) == ('pale_well', 'in', 0.0)


def test_a_well_whose_x_and_z_were_exchanged_is_named() -> None:
    rig = box_rig(**{'in': (0.2, 0.3), 'other': (0.05, 0.2)})
    maps = _discs()
    known = Known(rig=rig, pumped=Schedule((STOCK,)), times=TIMES, maps=maps, scaled_maps=maps)
    (remark,) = CHECK.find(known)
    assert (remark.code, remark.facts['well']) == ('exchanged_place', 'in')


def test_a_dilution_and_a_narrow_stream_fill_their_well() -> None:
    assert _codes(_discs(0.3), ScheduleRow(0.0, 'in', WellRate(1e-6, 0.3))) == []
    stream = (np.abs(GRID.z[:, None] - 0.2) < 0.006) & (GRID.x[None, :] >= 0.295)
    assert _codes([stream.astype(float)] * len(TIMES), STOCK) == []


@pytest.mark.parametrize(
    'later',
    [WellRate(0.0, 1.0), WellRate(1e-6, 0.0), WellRate(-1e-6), WellRate(1e-9, 0.5)],
)
def test_a_well_that_does_not_inject_its_tracer_any_more_is_not_judged(later: WellRate) -> None:
    empty = _discs()[:1] * len(TIMES)
    assert _codes(empty, STOCK, ScheduleRow(1.0, 'in', later)) == []


def test_a_plume_of_another_dye_hides_its_well() -> None:
    other_dye = [np.where(plume > 0.0, np.nan, plume) for plume in _discs()]
    assert _codes(other_dye, STOCK) == ['hidden_well']


def test_what_is_not_known_is_not_judged() -> None:
    hidden = [np.full(GRID.shape, np.nan)] * len(TIMES)
    assert _codes(hidden, STOCK) == []
    assert _codes(_discs(hole=0.03)) == []


def test_tracer_that_comes_late_is_no_contradiction() -> None:
    late = [_discs()[0], *_discs()[:-1]]
    assert _codes(late, STOCK) == []


def test_only_wells_with_tracer_are_judged() -> None:
    empty = _discs()[:1] * len(TIMES)
    other = ScheduleRow(0.0, 'other', WellRate(1e-6, 1.0))
    water = ScheduleRow(0.0, 'in', WellRate(1e-6, 0.0))
    assert [one.facts['well'] for one in _found(_discs(), STOCK, other)] == ['other']
    assert _codes(empty, water) == []
