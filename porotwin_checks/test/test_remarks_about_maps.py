"""Oddities of the tracer in recorded maps, as all checks together tell them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from porotwin_checks.all_checks import OF_MAPS, OF_TABLES, remarks_about
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig

RIGS = Path(__file__).resolve().parents[2] / 'rigs'

RIG = load_rig(RIGS / 'small')


def recording(*, level: float, from_s: float = 0.0, first: float = 0.0) -> Known:
    """Return ten maps over an hour that hold `level` in a tenth of the rig.

    The first map holds `first` there. 500 ml/h of stock flow from `from_s` on.
    """
    values = np.zeros((10, 30, 50), np.float32)
    values[:, :3] = level
    values[0, :3] = first
    if level > 0.0:
        values[1:, :3, 20:30] = max(level, 0.9)  # as strong as it leaves the well
    values[:, -1, -1] = 1e-3 * np.arange(10)  # no two photographs are the same
    rate = WellRate(from_ml_h(500.0), 1.0)
    commanded = Schedule((ScheduleRow(from_s, 'injector', rate),))
    times = np.linspace(0.0, 3600.0, 10)
    return Known(
        rig=RIG,
        commanded=commanded,
        pumped=commanded,
        times=times,
        maps=values,
        scaled_maps=values,
    )


def plume(lateness: float = 0.0) -> Known:
    """Return maps of a disc at the injector, with the stock of `lateness` [s] later."""
    given = recording(level=0.0)
    grid, well = given.grid, RIG.wells['injector']
    x, z = np.meshgrid(grid.x, grid.z)
    nearest = np.argsort(np.hypot(x - well.x_m, z - well.z_m), axis=None)
    values = np.zeros((10, nearest.size), np.float32)
    for frame, time in zip(values, given.times, strict=True):
        injected = given.rates.injected_stock(0.0, time + lateness)
        frame[nearest[: round(injected / RIG.cell_pore_volume(grid).mean())]] = 1.0
    return with_maps(given, values.reshape(10, grid.nz, grid.nx))


def with_maps(given: Known, values: NDArray[np.float32]) -> Known:
    return replace(given, maps=values, scaled_maps=values)


def found(given: Known) -> tuple[Remark, ...]:
    return remarks_about(given, OF_MAPS)


def codes(given: Known) -> list[str]:
    return [remark.code for remark in found(given)]


def test_tracer_that_the_pumps_injected_is_not_odd() -> None:
    assert codes(plume()) == []


@pytest.mark.parametrize(
    ('given', 'code'),
    [
        ({'level': 20.0}, 'no_stock'),
        ({'level': 1.0, 'first': 0.0, 'from_s': 3500.0}, 'too_much_tracer'),
        ({'level': 0.9, 'first': 0.35}, 'earlier_tracer'),
        ({'level': 0.9, 'first': 0.9}, 'earlier_tracer'),
    ],
)
def test_tracer_that_no_pump_explains_is_told(given: dict[str, float], code: str) -> None:
    assert code in codes(recording(**given))


def test_a_plume_around_the_injector_may_be_that_of_a_late_clock() -> None:
    assert codes(plume(lateness=300.0)) == ['late_or_used']


def test_maps_in_reversed_order_are_told() -> None:
    given = recording(level=0.0)
    grid = given.grid
    injected = [given.rates.injected_stock(0.0, time) for time in given.times]
    levels = np.array(injected) / RIG.pore_volume
    values = np.repeat(levels[::-1], grid.nx * grid.nz).reshape(10, grid.nz, grid.nx)
    assert 'reversed_maps' in codes(with_maps(given, values))
    constant = with_maps(given, np.full_like(values, levels[-1]))
    assert 'reversed_maps' not in codes(constant)


def test_maps_without_tracer_in_spite_of_an_injection_are_told() -> None:
    (remark,) = found(recording(level=0.0))
    assert remark.code == 'no_tracer'
    assert (remark.facts['empty'], remark.facts['maps']) == (9, 9)


def test_tracer_before_a_rest_is_a_start_that_the_model_takes() -> None:
    assert codes(recording(level=0.9, first=0.9, from_s=4000.0)) == []


def test_a_clean_start_after_an_injection_is_told() -> None:
    given = plume()
    (remark,) = found(replace(given, times=given.times + 2000.0))
    assert remark.code == 'too_little_tracer'
    assert remark.facts['pumped_ml'] == pytest.approx(278.0, abs=0.5)


def test_a_clock_that_was_set_is_told_among_the_odd_times() -> None:
    given = plume()
    later = np.where(given.times > 1800.0, given.times + 7200.0, given.times)
    remark, _ = remarks_about(replace(given, times=later), OF_TABLES)  # no row of the producer
    assert (remark.code, remark.key) == ('odd_interval', 'concentration.nc at 1600 s')
    assert 'odd_interval' not in {one.code for one in remarks_about(given, OF_TABLES)}


def test_empty_maps_and_hidden_cells_are_told_as_what_they_are() -> None:
    given = plume()
    values = np.array(given.maps)
    values[6:] = np.nan
    (empty,) = found(with_maps(given, values))
    assert (empty.code, empty.facts['count'], empty.facts['time_s']) == ('empty_maps', 4, 2400.0)
    values = np.array(given.maps)
    values[:, :, : values.shape[2] // 2] = np.nan
    shares = {one.code: one.facts.get('share') for one in found(with_maps(given, values))}
    assert shares['unseen_cells'] == 0.5


def test_maps_without_any_value_are_told_once() -> None:
    given = plume()
    assert codes(with_maps(given, np.full_like(given.maps, np.nan))) == ['no_values']


def test_maps_that_stand_still_or_have_an_offset_are_told() -> None:
    given = plume()
    values = np.array(given.maps)
    values[6:] = values[6]
    (still,) = found(with_maps(given, values))
    assert (still.code, still.facts['count']) == ('repeated_maps', 3)
    values = np.array(given.maps) + np.float32(0.06)
    assert 'clean_sand' in codes(with_maps(given, values))


def test_single_cells_that_no_neighbour_is_like_are_told() -> None:
    given = plume()
    values = np.array(given.maps)
    values[:, 26, 3] = 1.0
    (remark,) = found(with_maps(given, values))
    assert (remark.code, remark.facts['count']) == ('lone_cells', 10)
    assert remark.facts['x_m'] == pytest.approx(0.065, abs=5e-4)


@pytest.mark.parametrize('level', [1.8, 2.5])
def test_one_hot_cell_has_one_remedy(level: float) -> None:
    """The scale of the maps was asked too, and wanted NaN where a diagnosis needs none."""
    given = plume()
    values = np.array(given.maps)
    values[:, 26, 3] = level
    assert codes(with_maps(given, values)) == ['lone_cells']


@pytest.mark.parametrize(
    ('turned', 'named'),
    [
        (np.s_[:, ::-1], 'upside down'),
        (np.s_[:, :, ::-1], 'swapped left and right'),
        (np.s_[:, ::-1, ::-1], 'turned by 180 degrees'),
        (np.s_[:], ''),
    ],
)
def test_turned_maps_are_told(turned: Any, named: str) -> None:
    well = RIG.wells['injector'].model_copy(update={'x_m': 0.1, 'z_m': 0.1})
    rig = RIG.model_copy(update={'wells': {'injector': well}})
    given = replace(plume(), rig=rig)
    values = np.array(given.maps)
    values[1:, :13, :11] = 1.0
    remarks = found(with_maps(given, values[turned]))
    seems = [one.facts['turned'] for one in remarks if one.code == 'turned_maps']
    assert seems == [named] * bool(named)


def test_turned_maps_are_told_by_the_first_ones_if_later_plumes_cover_the_well() -> None:
    well = RIG.wells['injector'].model_copy(update={'x_m': 0.1, 'z_m': 0.1})
    rig = RIG.model_copy(update={'wells': {'injector': well}})
    given = replace(recording(level=0.0), rig=rig)
    values = np.array(given.maps)
    values[1:5, -13:, :11] = 1.0
    values[5:, :, :11] = 1.0
    turned = [one.facts.get('turned') for one in found(with_maps(given, values))]
    assert 'upside down' in turned


def test_rates_of_the_wrong_sign_are_told() -> None:
    wells = {
        name: RIG.wells['injector'].model_copy(update={'x_m': x_m, 'z_m': 0.1})
        for name, x_m in (('source', 0.1), ('sink', 0.8))
    }
    given = replace(recording(level=0.0), rig=RIG.model_copy(update={'wells': wells}))
    values = np.array(given.maps)
    values[1:, :13, -16:] = 1.0  # at the well that takes water out by the log
    rates = {'source': from_ml_h(500.0), 'sink': from_ml_h(-500.0)}
    rows = (ScheduleRow(0.0, well, WellRate(rate, 1.0)) for well, rate in rates.items())
    schedule = Schedule(tuple(rows))
    odd = replace(with_maps(given, values), commanded=schedule, pumped=schedule)
    assert 'turned_sign' in codes(odd)


def test_exchanged_maps_are_told() -> None:
    given = recording(level=0.0)
    values = np.zeros((10, 30, 50), np.float32)
    for number in range(10):
        values[number, 4:12, : 2 * number] = 1.0
    assert 'out_of_course' not in codes(with_maps(given, values))
    values[[4, 5]] = values[[5, 4]]
    remarks = found(with_maps(given, values))
    odd = [one.facts['times_s'] for one in remarks if one.code == 'out_of_course']
    assert odd == [[1600.0, 2000.0]]


def test_an_old_plume_where_no_well_injects_is_told() -> None:
    given = recording(level=0.0)
    times = given.times + 600.0  # 83 ml were injected before the first map
    values = np.array(given.maps)
    well = RIG.wells['injector']
    column, row = int(well.x_m / RIG.width_m * 50), int(well.z_m / RIG.height_m * 30)
    values[:, row - 3 : row + 3, column - 3 : column + 3] = 0.9

    def told(values: NDArray[np.float32]) -> list[Remark]:
        remarks = found(replace(with_maps(given, values), times=times))
        return [one for one in remarks if one.code == 'first_plume']

    assert told(values) == []
    values[:, 22:28, 40:49] = 0.5
    (remark,) = told(values)
    assert remark.facts['time_s'] == 600.0
    assert remark.facts['x_m'] == pytest.approx(0.831, abs=5e-4)
    assert remark.facts['z_m'] == pytest.approx(0.468, abs=5e-4)
