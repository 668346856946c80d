"""Tests of odd recordings: wrong units of rates and times, photographs that do not fit."""

import re
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from recording_examples import controlled_rig

from porotwin_checks.all_checks import OF_TABLES, remarks_about
from porotwin_checks.checks.announced_pauses import CHECK as PAUSES
from porotwin_checks.checks.map_values import CHECK
from porotwin_checks.checks.rate_limits import CHECK as LIMITS
from porotwin_checks.checks.unbalanced_rates import CHECK as UNBALANCED
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML, from_ml_h, to_ml_h
from porotwin_core.model.gauge_reading import GaugeKind, GaugeReading
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries, Rig
from porotwin_core.rig.control_section import FixedWell


def with_control(**changes: Any) -> Rig:
    """Return the rig with `changes` of its control section."""
    rig = controlled_rig()
    assert rig.control is not None
    return rig.model_copy(update={'control': rig.control.model_copy(update=changes)})


RIG = with_control(producer=None)


def recording(
    *, rate_ml_h: float = 523.2, last: float = 1800.0, end: float = 4800.0, value: float = 0.5
) -> Known:
    """Return a recording with one injection until `last` [s] and two maps until `end` [s]."""
    rows = (
        ScheduleRow(0.0, 'in', WellRate(from_ml_h(rate_ml_h), 1.0)),
        ScheduleRow(last, 'in', WellRate()),
    )
    values = np.full((2, 4, 5), value, np.float32)
    rates = Schedule(rows)
    return Known(rig=RIG, commanded=rates, pumped=rates, times=[0.0, end], maps=values)


class Photo(NamedTuple):
    time: float
    name: str
    role: str


def photo(time: float, name: str, role: str = 'state') -> Photo:
    return Photo(time, name, role)


def found_in(known: Known) -> tuple[Remark, ...]:
    return remarks_about(known, OF_TABLES)


def values(known: Known) -> list[Remark]:
    return list(CHECK.find(known))


REST = WellRate()
BASELINE = photo(-30.0, 'a.jpg', 'baseline')


def test_a_usual_recording_is_not_odd() -> None:
    data = replace(recording(), photos=(BASELINE, photo(0.0, 'b.jpg')))
    assert found_in(data) == ()
    assert values(data) == []


def test_rates_that_the_control_section_does_not_allow_are_odd() -> None:
    found = list(found_in(recording(rate_ml_h=400.0)))
    assert [remark.code for remark in found] == ['rate_limits']


def test_a_rate_at_its_limit_is_not_odd() -> None:
    """107.4 ml/h becomes a little more in SI and back."""
    rates = ScheduleRow(0.0, 'in', WellRate(from_ml_h(107.4)))
    rig = with_control(wells=('in',), fixed={}, max_rate_ml_h=107.4, max_total_rate_ml_h=107.4)
    assert to_ml_h(rates.rate.rate) > 107.4
    assert list(LIMITS.find(Known(rig=rig, commanded=Schedule((rates,))))) == []


def test_measured_rates_that_a_closed_rig_cannot_have_are_told() -> None:
    """The model runs with them."""
    data = recording()
    rig = data.rig.model_copy(update={'boundaries': Boundaries(top='closed'), 'control': None})
    told, measured = (
        Schedule.from_rates([(0.0, {'in': WellRate(from_ml_h(a)), 'out': WellRate(from_ml_h(b))})])
        for a, b in ((300.0, -300.0), (301.0, -298.0))
    )
    known = Known(rig=rig, commanded=told, measured=measured, pumped=measured)
    (found,) = UNBALANCED.find(known)
    assert found.facts['sum_ml_h'] == pytest.approx(3.0)
    assert not list(UNBALANCED.find(replace(known, measured=None, pumped=told)))


def test_a_producer_that_injects_is_odd() -> None:
    data = recording()
    rows = (*data.commanded.rows, ScheduleRow(0.0, 'out', WellRate(from_ml_h(500.0))))
    data = replace(data, rig=with_control(), commanded=Schedule(rows))
    found = [one.key for one in found_in(data) if one.code == 'rate_limits']
    assert found == ['rates.csv: well out']


def test_a_chase_with_water_at_another_rate_is_not_odd() -> None:
    data = recording()
    chase = ScheduleRow(60.0, 'in', WellRate(from_ml_h(90.0), 0.0))
    first, last = data.commanded.rows
    data = replace(data, commanded=Schedule((first, chase, last)))
    assert list(found_in(data)) == []


def test_a_recording_that_ends_before_a_pause_does_not_pump_through_it() -> None:
    rests = FixedWell(rate_ml_h=523.2, concentration=1.0, pauses_min=((20.0, 30.0),))
    rig = with_control(fixed={'in': rests}, end_min=80.0, producer=None)
    told = Schedule(recording().commanded.rows[:1])
    codes = [
        [one.code for one in PAUSES.find(Known(rig=rig, commanded=told, times=times))]
        for times in ([0.0, 540.0], [0.0, 1900.0], [])
    ]
    assert codes == [[], ['pumps_in_pause'], ['pumps_in_pause']]


def test_control_wells_that_inject_too_much_together_are_odd() -> None:
    data = replace(recording(), rig=with_control(producer=None, max_total_rate_ml_h=150.0))
    rows = [ScheduleRow(60.0, 'water', WellRate(from_ml_h(rate))) for rate in (150.0, 160.0)]
    found = [
        [(remark.code, remark.value) for remark in found_in(replace(data, commanded=schedule))]
        for schedule in (Schedule((*data.commanded.rows, row)) for row in rows)
    ]
    assert found == [[], [('sum_of_rates', '160 ml/h')]]


def test_a_producer_without_a_row_is_odd() -> None:
    data = replace(recording(), rig=controlled_rig())
    assert [remark.code for remark in found_in(data)] == ['idle_producer']
    rests = Schedule((*data.commanded.rows, ScheduleRow(0.0, 'out', REST)))
    assert list(found_in(replace(data, commanded=rests))) == []


def test_rates_without_an_end_are_odd() -> None:
    data = replace(recording(last=0.0), times=())
    assert 'no_end' in [remark.code for remark in found_in(data)]


def test_rates_whose_last_rows_pump_say_no_end_of_the_experiment() -> None:
    rows = (
        ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
        ScheduleRow(600.0, 'out', WellRate(from_ml_h(-523.2))),
    )
    assert [one.code for one in found_in(Known(rig=RIG, commanded=Schedule(rows)))] == ['no_end']


@pytest.mark.parametrize(
    ('change', 'named', 'refused'),
    [
        ({'rate_ml_h': 5.6e-8}, 'rates.csv: well in is 5.6e-08 ml/h: .*was this in m3/s', True),
        ({'rate_ml_h': 5e8}, 'rates.csv: well in is 5e.08 ml/h', True),
        ({'rate_ml_h': 2e4}, 'rates.csv: well in is 20000 ml/h', False),
        ({'last': 80.0}, 'rates.csv: its times end at 80 s, .* in minutes', False),
        ({'last': 4500.0, 'end': 80.0}, 'concentration.nc .* in minutes', False),
        ({'last': 4500.0, 'end': 1.3}, 'concentration.nc .* in hours', False),
        ({'last': 4500.0, 'end': 4.6e6}, 'concentration.nc .* in milliseconds', False),
        ({'last': 4500.0, 'end': 6e6}, 'concentration.nc .* in milliseconds', False),
    ],
)
def test_a_mistaken_unit_is_named(change: dict[str, float], named: str, refused: bool) -> None:
    (remark,) = found_in(recording(**change))
    assert remark.refused is refused
    assert re.search(named, str(remark))


def test_two_rates_of_a_well_at_one_time_are_odd() -> None:
    rows = [ScheduleRow(0.0, 'in', WellRate(from_ml_h(rate), 1.0)) for rate in (523.2, 400.0)]
    rows.append(ScheduleRow(60.0, 'in', WellRate()))
    found = found_in(Known(rig=RIG, commanded=Schedule(tuple(rows))))
    assert [remark.code for remark in found] == ['two_rates']


@pytest.mark.parametrize(('value', 'count'), [(0.25, 1), (0.9, 0), (0.0, 0)])
def test_maps_far_paler_than_the_injected_stock_are_odd(value: float, count: int) -> None:
    found = values(replace(recording(), maps=np.full((2, 56, 93), value, np.float32)))
    assert [remark.code for remark in found] == count * ['faint_maps']


@pytest.mark.parametrize(
    ('photos', 'code'),
    [
        ((photo(0.0, 'a.jpg'),), 'no_baseline'),
        ((BASELINE, photo(0.0, 'b.jpg'), photo(30.0, 'b.jpg')), 'listed_twice'),
        ((BASELINE, photo(0.0, 'b.jpg'), photo(0.0, 'c.jpg')), 'same_time'),
        ((BASELINE, photo(0.0, 'b.jpg'), photo(7.0, 'c.jpg'), photo(7.0, 'd.jpg')), 'same_time'),
        ((photo(0.0, 'b.jpg'), photo(9.0, 'c.jpg', 'baseline')), 'late_baseline'),
    ],
)
def test_photographs_that_do_not_fit_are_named(photos: tuple[Photo, ...], code: str) -> None:
    assert [remark.code for remark in found_in(Known(rig=RIG, photos=photos))] == [code]


def test_all_photographs_in_several_lines_are_told_with_their_roles() -> None:
    listed = (BASELINE, photo(0.0, BASELINE.name), photo(30.0, 'b.jpg'), photo(60.0, './b.jpg'))
    (remark,) = found_in(Known(rig=RIG, photos=listed))
    assert remark.code == 'listed_twice'
    assert remark.facts['roles'] == {
        BASELINE.name: ['baseline', 'state'],
        'b.jpg': ['state', 'state'],
    }


@pytest.mark.parametrize(
    ('value', 'named'),
    [(50.0, 'percent'), (255.0, 'grey values'), (2.0, 'scale')],
)
def test_maps_that_are_no_concentrations_are_named(value: float, named: str) -> None:
    (remark,) = values(recording(value=value))
    assert named in str(remark)


@pytest.mark.parametrize(
    ('photos', 'named'),
    [
        (
            (photo(30.0, 'b.jpg'), photo(60.0, 'a.jpg', 'baseline')),
            '60 s: a baseline comes after the tracer, there from 0 s on',
        ),
        (
            (BASELINE, photo(2588340.0, 'b.jpg')),
            'imaging.csv: it is from 2588340 .* clocks of camera',
        ),
        ((BASELINE, photo(-1e5, 'b.jpg')), 'the rates are from 0 to 1800 s'),
        (
            (photo(-3600.0, 'a.jpg', 'baseline'), *(photo(t, 'b') for t in (-900.0, -60.0, 30.0))),
            'it is from -900 to 30 s, and the rates are from 0 to 1800 s',
        ),
    ],
)
def test_photographs_that_miss_the_pumps_are_odd(photos: tuple[Photo, ...], named: str) -> None:
    found = list(found_in(replace(recording(), times=(), photos=photos)))
    assert sum(bool(re.search(named, str(remark))) for remark in found) == 1, found
    codes = [remark.code for remark in found]
    assert len(set(codes)) == len(codes)


def measured(*rows: tuple[float, str, float]) -> Known:
    """Return a recording of two wells with the `rows` (time [s], well, rate [ml/h]) measured."""
    asked = [(0.0, 'in', 523.2), (0.0, 'out', -523.2), (1800.0, 'in', 0.0), (1800.0, 'out', 0.0)]
    commanded, seen = (
        Schedule(tuple(ScheduleRow(t, well, WellRate(from_ml_h(rate))) for t, well, rate in given))
        for given in (asked, rows)
    )
    return replace(recording(), commanded=commanded, measured=seen)


@pytest.mark.parametrize(
    ('rows', 'code'),
    [
        ([(0.0, 'in', 520.0), (1800.0, 'in', 0.0)], 'unmeasured_wells'),
        ([(0.0, 'in', 520.0), (1200.0, 'out', -520.0)], 'measured_rates_end'),
        ([(0.0, 'in', 8.7), (0.0, 'out', -8.7), (1801.0, 'in', 0.0)], 'other_unit'),
        ([(0.0, 'in', 523.2), (0.0, 'out', 523.2), (1801.0, 'in', 0.0)], 'other_sign'),
        ([(86400.0, 'in', 523.2), (86400.0, 'out', -523.2)], 'other_clock'),
    ],
)
def test_incomplete_or_far_measured_rates_are_named(rows, code: str) -> None:
    assert [one.code for one in found_in(measured(*rows)) if 'measured' in one.key] == [code]


def test_a_measured_change_of_fluid_that_is_missing_is_odd() -> None:
    def fluids(*rows: tuple[float, float, float]) -> Schedule:
        return Schedule(tuple(ScheduleRow(t, 'in', WellRate(q, share)) for t, q, share in rows))

    asked = fluids((0.0, 1e-7, 1.0), (600.0, 1e-7, 0.0), (1800.0, 0.0, 0.0))
    wrong = fluids((0.0, 9e-8, 1.0), (900.0, 9e-8, 1.0), (1800.0, 0.0, 1.0))
    right = fluids((0.0, 9e-8, 1.0), (600.0, 9e-8, 0.0), (1800.0, 0.0, 0.0))
    for seen, expected in (
        (wrong, ["rates_measured.csv: concentration of well 'in' at 600 s"]),
        (right, []),
    ):
        data = replace(recording(), commanded=asked, measured=seen)
        found = [one.key for one in found_in(data) if 'measured' in one.key]
        assert found == expected


def test_measured_rates_that_cover_everything_are_not_odd() -> None:
    rows = [(0.0, 'in', 520.0), (0.0, 'out', -511.0), (1801.0, 'in', 0.0), (1801.0, 'out', 0.0)]
    assert not [one for one in found_in(measured(*rows)) if 'measured' in one.key]


def test_rates_that_are_confirmed_after_the_last_command_are_not_odd() -> None:
    data = measured((115.0, 'in', 523.2), (115.0, 'out', -523.2))
    assert data.commanded is not None
    running = Schedule(data.commanded.rows[:2])  # the pumps go on: the last rows are no end
    found = found_in(replace(data, commanded=running))
    assert not [one for one in found if 'measured' in one.key]


@pytest.mark.parametrize(
    ('steps', 'odd'),
    [
        (12 * [30.0], False),
        ([*(8 * [30.0]), 60.0, 30.0, 90.0], False),  # lost photographs
        ([*(8 * [30.0]), 330.0, *(4 * [30.0])], True),
        ([*(8 * [30.0]), 75.0, *(4 * [30.0])], True),
        ([10.0, 20.0, 40.0, 80.0, 160.0, 320.0, 640.0], False),  # no regular camera
    ],
)
def test_an_odd_interval_asks_for_the_clock(steps: list[float], odd: bool) -> None:
    times = np.concatenate([[0.0], np.cumsum(steps)])
    photos = tuple(photo(float(time), f'{time:g}.jpg') for time in times)
    found = [str(one) for one in found_in(replace(recording(), photos=photos))]
    assert any('was the clock of the camera set' in line for line in found) is odd


def test_maps_that_are_late_as_a_whole_are_no_matter_of_units() -> None:
    rows = (
        ScheduleRow(0.0, 'in', WellRate(from_ml_h(523.2), 1.0)),
        ScheduleRow(1800.0, 'in', REST),
    )
    times = 86400.0 + np.array([0.0, 900.0, 2700.0])
    for last in (rows, rows[:1]):
        data = Known(rig=RIG, commanded=Schedule(last), times=times)
        (found,) = found_in(data)
        assert (found.code, found.facts['first_s']) == ('other_times', 86400.0)


@pytest.mark.parametrize(
    ('pauses', 'told'),
    [
        ((), None),
        (((30.0, 40.0),), None),  # the commands let it rest already
        (((28.0, 40.0),), None),  # they end in the pause, as setpoints do
        (((10.0, 20.0), (21.0, 22.0)), (10.0, 20.0)),
    ],
)
def test_rates_through_an_announced_pause_are_told(
    pauses: tuple[tuple[float, float], ...], told: tuple[float, float] | None
) -> None:
    assert RIG.control is not None
    fixed = {'in': RIG.control.fixed['in'].model_copy(update={'pauses_min': pauses})}
    rig = with_control(producer=None, fixed=fixed)
    found = [one for one in found_in(replace(recording(), rig=rig)) if one.key == 'rates.csv']
    if told is None:
        assert not found
    else:
        (one,) = found
        assert (one.facts['begin_min'], one.facts['end_min']) == told
        assert one.facts['told_ml'] == pytest.approx(523.2 / 2)
        assert one.facts['run_ml'] == pytest.approx(523.2 * (30.0 - 11.0) / 60.0)


def test_rates_say_nothing_of_a_pause_after_the_recording() -> None:
    assert RIG.control is not None
    fixed = {'in': RIG.control.fixed['in'].model_copy(update={'pauses_min': ((10.0, 20.0),)})}
    rig = with_control(producer=None, fixed=fixed, end_min=30.0)
    running = Schedule((ScheduleRow(0.0, 'in', WellRate(from_ml_h(500.0), 1.0)),))
    for end, told in ((480.0, 0), (900.0, 1)):
        known = Known(rig=rig, commanded=running, pumped=running, photos=[Photo(end, 'a', 'state')])
        assert [one.code for one in found_in(known)].count('pumps_in_pause') == told


OUT, PRESSURE, DYE = GaugeKind.OUTFLOW, GaugeKind.PRESSURE, GaugeKind.CONCENTRATION
PUMPED_ML = 523.2 / 2
"""What the well 'in' injects until 1800 s."""


@pytest.mark.parametrize(
    ('readings', 'codes'),
    [
        ([GaugeReading(1800.0, OUT, -PUMPED_ML / ML, 1.0 / ML, 'in')], []),
        ([GaugeReading(1800.0, OUT, PUMPED_ML / ML, 1.0 / ML, 'in')], ['other_outflow']),
        ([GaugeReading(1800.0, OUT, -PUMPED_ML / 1e3 / ML, 1.0 / ML, 'in')], ['other_outflow']),
        ([GaugeReading(1800.0, OUT, 40.0 / ML, 1.0 / ML, 'out')], ['other_outflow']),
        ([GaugeReading(1800.0, OUT, 2.0 / ML, 1.0 / ML, 'out')], []),
        ([GaugeReading(1800.0, DYE, 0.2, 0.1, 'in')], ['no_outflow']),
        ([GaugeReading(9.0, PRESSURE, 20.0, 1.0, '', (0.1, 0.1), (0.1, 0.1))], ['same_port']),
        ([GaugeReading(9.0, PRESSURE, value, 1.0, '', (0.1, 0.1)) for value in (4.0, 6.0)], []),
        (
            [GaugeReading(9.0, PRESSURE, value, 1.0, '', (0.1, 0.1)) for value in (4.0, 16.0)],
            ['two_readings'],
        ),
    ],
)
def test_readings_that_cannot_be_right_are_odd(
    readings: list[GaugeReading], codes: list[str]
) -> None:
    found = found_in(replace(recording(), readings=readings))
    assert [remark.code for remark in found] == codes


def test_a_plan_ends_with_the_experiment_and_later_rows_are_told() -> None:
    """`check` told two ends: by the control section, and by the last row of the plan."""
    data = recording(last=4500.0)
    rig = with_control(end_min=60.0, producer=None)
    plan = replace(data, rig=rig, times=(), maps=None)
    assert plan.end == 3600.0
    assert 'rows_after_end' in {one.code for one in found_in(plan)}
    assert 'rows_after_end' not in {one.code for one in found_in(replace(plan, rig=RIG))}
    recorded = replace(data, rig=rig, times=[0.0, 4200.0])
    assert recorded.end == 4500.0
    assert 'rows_after_end' not in {one.code for one in found_in(recorded)}
