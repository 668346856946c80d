"""Oddities of the tracer in recorded maps."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import load_rig
from porotwin_diagnosis.data.odd_tracer import odd_times, remarks_about_tracer
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps

RIG = load_rig('rigs/small')


def recording(*, level: float, from_s: float = 0.0, first: float = 0.0) -> Recording:
    """Return ten maps over an hour that hold `level` in a tenth of the rig.

    The first map holds `first` there. 500 ml/h of stock flow from `from_s` on.
    """
    values = np.zeros((10, 30, 50), np.float32)
    values[:, :3] = level
    values[0, :3] = first
    if level > 0.0:
        values[1:, :3, 20:30] = max(level, 0.9)  # as strong as it leaves the well
    values[:, -1, -1] = 1e-3 * np.arange(10)  # no two photographs are the same
    maps = ConcentrationMaps(
        np.linspace(0.0, 3600.0, 10), RIG.grid(50, 30), lambda a, b: values[a:b]
    )
    rate = WellRate(from_ml_h(500.0), 1.0)
    commanded = Schedule((ScheduleRow(from_s, 'injector', rate),))
    return Recording(RIG, commanded=commanded, maps=maps, source=Path('run'))


def with_maps(given: Recording, values: NDArray[np.float32]) -> Recording:
    maps = given.present_maps
    read = ConcentrationMaps(maps.times, maps.grid, lambda a, b: values[a:b])
    return replace(given, maps=read)


def test_tracer_that_the_pumps_injected_is_not_odd() -> None:
    assert not list(remarks_about_tracer(recording(level=0.2)))


@pytest.mark.parametrize(
    ('given', 'named'),
    [
        ({'level': 20.0}, 'was this in percent'),
        ({'level': 1.0, 'first': 0.0, 'from_s': 3500.0}, 'but the pumps injected'),
        ({'level': 0.9, 'first': 0.35}, 'from before the recording, with which the model starts'),
        ({'level': 0.9, 'first': 0.9}, 'from before the recording, with which the model starts'),
    ],
)
def test_tracer_that_no_pump_explains_is_told(given: dict[str, float], named: str) -> None:
    assert any(named in str(remark) for remark in remarks_about_tracer(recording(**given)))


def test_a_plume_around_the_injector_may_be_that_of_a_late_clock() -> None:
    given = recording(level=0.2)
    maps, well = given.present_maps, RIG.wells['injector']
    x, z = np.meshgrid(maps.grid.x, maps.grid.z)
    nearest = np.argsort(np.hypot(x - well.x_m, z - well.z_m), axis=None)
    values = np.zeros((10, nearest.size), np.float32)
    for frame, time in zip(values, maps.times, strict=True):
        injected = given.delivered.injected_stock(0.0, time + 300.0)
        frame[nearest[: round(injected / RIG.cell_pore_volume(maps.grid).mean())]] = 1.0
    late = with_maps(given, values.reshape(10, maps.grid.nz, maps.grid.nx))
    (remark,) = remarks_about_tracer(late)
    assert remark.why.startswith('the clock of the camera is late, or the rig held tracer before')


def test_maps_in_reversed_order_are_told() -> None:
    given = recording(level=0.0)
    maps = given.present_maps
    cells = maps.grid.nx * maps.grid.nz
    injected = [given.delivered.injected_stock(0.0, time) for time in maps.times]
    levels = np.array(injected) / RIG.pore_volume
    values = np.repeat(levels[::-1], cells).reshape(10, maps.grid.nz, maps.grid.nx)
    found = remarks_about_tracer(with_maps(given, values))
    assert any(r.why.endswith('injected if the last one comes first') for r in found)
    constant = with_maps(given, np.full_like(values, levels[-1]))
    assert not any(
        'last one comes first' in remark.why for remark in remarks_about_tracer(constant)
    )


def test_maps_without_tracer_in_spite_of_an_injection_are_told() -> None:
    (remark,) = remarks_about_tracer(recording(level=0.0))
    assert remark.why.startswith('7 of 7 maps that were looked at show no tracer')


def test_tracer_before_a_rest_is_a_start_that_the_model_takes() -> None:
    assert not list(remarks_about_tracer(recording(level=0.9, first=0.9, from_s=4000.0)))


def test_a_clean_start_after_an_injection_is_told() -> None:
    given = recording(level=0.2)
    maps = given.present_maps
    late = ConcentrationMaps(maps.times + 2000.0, maps.grid, lambda a, b: maps[a:b])
    (remark,) = remarks_about_tracer(replace(given, maps=late))
    assert 'but the pumps injected 278 ml before it' in remark.why


def test_a_clock_that_was_set_is_told_among_the_odd_times() -> None:
    given = recording(level=0.2)
    maps = given.present_maps
    later = np.where(maps.times > 1800.0, maps.times + 7200.0, maps.times)
    set_forward = ConcentrationMaps(later, maps.grid, lambda a, b: maps[a:b])
    (line,) = odd_times([replace(given, maps=set_forward)])
    assert line.startswith('run: concentration.nc at 1600 s: 7600 s pass to the next one')
    assert not odd_times([given])


def test_empty_maps_and_hidden_cells_are_told_as_what_they_are() -> None:
    given = recording(level=0.2)
    values = np.array(given.present_maps[:])
    values[6:] = np.nan
    (empty,) = remarks_about_tracer(with_maps(given, values))
    assert empty.why.startswith('4 maps hold no value (NaN everywhere), the first at')
    values = np.array(given.present_maps[:])
    values[:, :, : values.shape[2] // 2] = np.nan
    told = [remark.why for remark in remarks_about_tracer(with_maps(given, values))]
    assert '50 % of the cells have no value (NaN) in any map' in told[0]


def test_maps_that_stand_still_or_have_an_offset_are_told() -> None:
    given = recording(level=0.2)
    values = np.array(given.present_maps[:])
    values[6:] = values[6]
    (still,) = remarks_about_tracer(with_maps(given, values))
    assert still.why.startswith('3 of 10 maps repeat another one to the last bit, the first at')
    values = np.array(given.present_maps[:]) + np.float32(0.06)
    assert any(
        'nearly everywhere' in one.why for one in remarks_about_tracer(with_maps(given, values))
    )


def test_single_cells_that_no_neighbour_is_like_are_told() -> None:
    given = recording(level=0.2)
    values = np.array(given.present_maps[:])
    values[:, 20, 9] = 1.0
    (remark,) = remarks_about_tracer(with_maps(given, values))
    assert remark.why.startswith('8 cells in 8 maps')
    assert 'x = 0.177 m' in remark.why


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
    given = replace(recording(level=0.2), rig=rig)
    values = np.array(given.present_maps[:])
    values[1:, :13, :11] = 1.0
    told = [one.why for one in remarks_about_tracer(with_maps(given, values[turned]))]
    seems = [why for why in told if 'seem to be' in why]
    assert [why.split(':')[0] for why in seems] == [f'the maps seem to be {named}'] * bool(named)


def test_turned_maps_are_told_by_the_first_ones_if_later_plumes_cover_the_well() -> None:
    well = RIG.wells['injector'].model_copy(update={'x_m': 0.1, 'z_m': 0.1})
    rig = RIG.model_copy(update={'wells': {'injector': well}})
    given = replace(recording(level=0.0), rig=rig)
    values = np.array(given.present_maps[:])
    values[1:5, -13:, :11] = 1.0
    values[5:, :, :11] = 1.0
    told = [remark.why for remark in remarks_about_tracer(with_maps(given, values))]
    assert any(why.startswith('the maps seem to be upside down') for why in told)


def test_rates_of_the_wrong_sign_are_told() -> None:
    wells = {
        name: RIG.wells['injector'].model_copy(update={'x_m': x_m, 'z_m': 0.1})
        for name, x_m in (('source', 0.1), ('sink', 0.8))
    }
    given = replace(recording(level=0.0), rig=RIG.model_copy(update={'wells': wells}))
    values = np.array(given.present_maps[:])
    values[1:, :13, -16:] = 1.0  # at the well that takes water out by the log
    rates = {'source': from_ml_h(500.0), 'sink': from_ml_h(-500.0)}
    rows = (ScheduleRow(0.0, well, WellRate(rate, 1.0)) for well, rate in rates.items())
    odd = replace(with_maps(given, values), commanded=Schedule(tuple(rows)))
    told = [one for one in remarks_about_tracer(odd) if 'wrong sign' in one.why]
    assert [one.remedy.split('. ')[0] for one in told] == ['a positive rate injects']


def test_exchanged_maps_are_told() -> None:
    given = recording(level=0.0)
    values = np.zeros((10, 30, 50), np.float32)
    for number in range(10):
        values[number, 4:12, : 2 * number] = 1.0
    assert not [one for one in remarks_about_tracer(with_maps(given, values)) if 'fit' in one.why]
    values[[4, 5]] = values[[5, 4]]
    told = [one for one in remarks_about_tracer(with_maps(given, values)) if 'fit' in one.why]
    assert [one.why.split(';')[0] for one in told] == [
        '2 of 10 maps fit neither the map before nor the one after them, at 1600, 2000 s'
    ]


def test_an_old_plume_where_no_well_injects_is_told() -> None:
    given = recording(level=0.0)
    times = given.present_maps.times + 600.0  # 83 ml were injected before the first map
    values = np.array(given.present_maps[:])
    well = RIG.wells['injector']
    column, row = int(well.x_m / RIG.width_m * 50), int(well.z_m / RIG.height_m * 30)
    values[:, row - 3 : row + 3, column - 3 : column + 3] = 0.9

    def told(values: NDArray[np.float32]) -> list[str]:
        maps = ConcentrationMaps(times, RIG.grid(50, 30), lambda a, b: values[a:b])
        remarks = remarks_about_tracer(replace(given, maps=maps))
        return [one.why for one in remarks if 'no well can have brought it' in one.why]

    assert told(values) == []
    values[:, 22:28, 40:49] = 0.5
    (why,) = told(values)
    assert why.startswith('the first map, at 600 s, shows tracer around x = 0.831 m, z = 0.468 m')
