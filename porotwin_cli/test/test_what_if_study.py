"""Outlooks of the siblings from a moment of a recording."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from lab.loop.bench_loop_scenarios import demo_scenario
from porotwin_cli.running.what_if_picture import what_if_picture
from porotwin_cli.running.what_if_study import (
    WhatIfStudy,
    horizon_ahead,
    later_steps,
    objections_to,
    rate_step,
    rate_steps,
    seconds_of,
    study_what_if,
    zone_noise,
)
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.clock.time_units import HOURS, MINUTES
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.wells import RateStep, Schedule, ScheduleRow, WellRate
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.map_camera import MapNoise
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_siblings.proposed_rates import proposed_plan
from porotwin_siblings.zone_measure import ZoneMeasure
from porotwin_solver.effects.rate import EFFECT as RATE


@pytest.fixture(scope='module')
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return forty minutes of the demo's rig, with a well switched on after thirty."""
    rig = demo_scenario().rig
    limits = Limits.of(rig)
    most = limits.setpoint(np.array([0.0, 0.0, limits.max_rate]))
    folder = tmp_path_factory.mktemp('study') / 'run'
    make_experiment(
        folder,
        VirtualRig(rig, cell=0.02),
        commanded=Schedule.from_rates([(0.0, limits.safe()), (1800.0, most)]),
        duration=2400.0,
        photo_interval=300.0,
        seed=3,
        noise=MapNoise.drawn(3),
        grid=rig.grid(31, 19),
    )
    return open_recording(folder)


@pytest.fixture(scope='module')
def found(recording: Recording) -> WhatIfStudy:
    """Return the outlooks from minute 25 on, with another well at its maximum."""
    step = rate_step('control1=500,control3=0', recording.rig, 1500.0)
    with ThreadPoolExecutor(2) as pool:
        return study_what_if(recording, 1500.0, [step], cells=589, executor=pool, siblings=24)


def test_the_present_plan_is_that_of_the_recording(found: WhatIfStudy) -> None:
    assert [step.start for step in found.present.plan] == [0.0, 300.0]
    assert to_ml_h(found.present.plan[1].rates['control3'].rate) == pytest.approx(500.0)


def test_the_producer_balances_the_proposal(found: WhatIfStudy) -> None:
    (step,) = found.proposed.plan
    assert to_ml_h(step.rates['producer'].rate) == pytest.approx(-1000.0)
    assert step.rates['injector'] == WellRate(from_ml_h(500.0), 1.0)
    assert found.objections == ()
    assert found.note == ''


def test_bands_hold_the_median_and_grow(found: WhatIfStudy) -> None:
    low, median, high = found.proposed.zone_tracer
    assert np.all(low <= median)
    assert np.all(median <= high)
    assert high[-1] - low[-1] > high[0] - low[0]


def test_later_photographs_are_shown_and_not_learnt_from(found: WhatIfStudy) -> None:
    np.testing.assert_allclose(found.seen_times, [1500.0, 1800.0, 2100.0, 2400.0])
    assert found.seen_tracer.shape == (4,)


def test_the_noise_of_clean_sand_is_told_for_the_whole_zone() -> None:
    rig = demo_scenario().rig
    grid = rig.grid(94, 56)
    zone = ZoneMeasure.of(rig, grid)
    noise = np.full(grid.shape, 0.002)
    assert zone_noise(noise, zone, grid) == pytest.approx(zone.tracer(noise))
    noise[0, 0] = np.nan
    assert zone_noise(noise, zone, grid) == pytest.approx(zone.tracer(np.nan_to_num(noise)))
    assert zone_noise(np.ones(grid.shape), zone, grid) == 0.0


def test_the_picture_is_drawn(found: WhatIfStudy, tmp_path: Path) -> None:
    what_if_picture(tmp_path / 'picture.png', found)
    assert (tmp_path / 'picture.png').stat().st_size > 20_000


def test_without_a_zone_only_the_plumes_are_drawn(
    found: WhatIfStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = found.rig.model_copy(update={'control': None})
    study = replace(found, rig=rig, seen_tracer=np.full(len(found.seen_times), np.nan))
    assert found.has_zone
    assert not study.has_zone
    drawn: list[Figure] = []
    monkeypatch.setattr('porotwin_cli.running.what_if_picture.plt.close', drawn.append)
    what_if_picture(tmp_path / 'picture.png', study)
    assert [axis.get_title() for axis in drawn[0].axes] == [
        'present, at 55 min',
        'proposed, at 55 min',
    ]
    assert 'zone' not in drawn[0].get_supxlabel()


def test_a_late_forecast_counts_hours(found: WhatIfStudy) -> None:
    assert found.time_unit is MINUTES
    assert replace(found, start=20 * 3600.0).time_unit is HOURS


def test_a_broken_limit_is_an_objection(recording: Recording) -> None:
    step = rate_step('control1=900', recording.rig, 1500.0)
    with ThreadPoolExecutor(2) as pool:
        found = study_what_if(
            recording,
            300.0,
            [step],
            cells=589,
            executor=pool,
            horizon=60.0,
            siblings=24,
        )
    assert any('control1' in line for line in found.objections)


PAUSED = (
    RateStep(0.0, Limits.of(demo_scenario().rig).safe()),
    RateStep(600.0, dict.fromkeys(demo_scenario().rig.wells, WellRate())),
    RateStep(1200.0, Limits.of(demo_scenario().rig).safe()),
)
"""A plan with a pause of the injection, which no setpoint may make."""


@pytest.mark.parametrize(
    ('rates', 'lines'),
    [
        ('control1=300', []),
        ('injector=600', ["from 40 min: well 'injector': 600.0 ml/h, but it must stay at 500.0"]),
        ('55min:injector=0', ["from 60 min: well 'injector': 0.0 ml/h, but it must stay"]),
        ('producer=-100', ['from 40 min: 400 ml/h more is injected than produced', '100 ml/h']),
        (
            '50min:control1=-50',
            [
                "from 50 min: well 'control1': -50.0 ml/h lies outside",
                "from 50 min: well 'producer': 50.0 ml/h, but the producer never injects",
            ],
        ),
    ],
)
def test_an_objection_tells_when_although_the_recording_has_pauses(
    rates: str, lines: list[str]
) -> None:
    rig = demo_scenario().rig
    plan = proposed_plan([rate_step(rates, rig, 2400.0)], PAUSED, 'producer')
    found = objections_to(rig, plan, PAUSED, 2400.0)
    assert len(found) == len(lines), found
    for objection, line in zip(found, lines, strict=True):
        assert line in objection


def test_a_proposal_rests_in_the_announced_pauses_of_a_well() -> None:
    rig = demo_scenario().rig
    assert rig.control is not None
    control = rig.control.with_pauses({'injector': ((50.0, 60.0),)}, 80.0)
    pausing = rig.model_copy(update={'control': control})
    plan = proposed_plan([rate_step('injector=600', rig, 2400.0)], PAUSED[:1], 'producer')
    found = FixedPauses.of(pausing).rested_plan(plan, 2400.0, 1800.0)
    rates = {step.start: to_ml_h(step.rates['injector'].rate) for step in found}
    assert rates == pytest.approx({0.0: 600.0, 600.0: 0.0, 1200.0: 600.0})
    producer = [step.rates['producer'].rate for step in found]
    assert producer[1] > producer[0], 'it takes out as much less'


def forecast(recording: Recording, start: float, horizon: float) -> WhatIfStudy:
    """Return a coarse study that proposes nothing."""
    with ThreadPoolExecutor(2) as pool:
        return study_what_if(
            recording, start, [], cells=135, executor=pool, horizon=horizon, siblings=24
        )


def test_the_first_map_alone_is_a_state(recording: Recording) -> None:
    found = forecast(recording, 0.0, 300.0)
    assert found.start == 0.0
    assert np.isfinite(found.present.zone_tracer).all()


def test_meters_tell_what_the_commands_of_a_plan_deliver(recording: Recording) -> None:
    pumped = recording.schedule

    def commanded(row: ScheduleRow) -> ScheduleRow:
        return replace(row, rate=replace(row.rate, rate=row.rate.rate / 0.6))

    high = Schedule(tuple(map(commanded, pumped.rows)))
    rows = [(time, pumped.at(time)) for time in np.arange(0.0, 2401.0, 300.0)]
    metered = replace(recording, commanded=high, measured=Schedule.from_rates(rows))
    found, usual = (forecast(one, 1200.0, 600.0) for one in (metered, recording))
    for well in ('injector', 'producer'):
        assert found.rate_factors[well].metered == pytest.approx(0.6)
    np.testing.assert_allclose(found.present.mean, usual.present.mean, atol=1e-3)
    told = forecast(replace(metered, by_hand=True), 600.0, 300.0)
    assert told.rate_factors['injector'].metered == 1.0, 'a person may be late'


def test_a_well_without_a_meter_is_not_taken_as_measured(recording: Recording) -> None:
    rows = [ScheduleRow(time, 'control1', WellRate()) for time in (0.0, 1200.0, 2400.0)]
    found, usual = (
        forecast(one, 1200.0, 300.0)
        for one in (replace(recording, measured=Schedule(tuple(rows))), recording)
    )
    assert found.rate_factors == usual.rate_factors


def test_an_effect_that_begins_later_is_not_learnt_as_a_pump(recording: Recording) -> None:
    def acting_from(since: float) -> Recording:
        rate = RATE.described(well='injector', factor=2.0, since=since)
        return replace(recording, rig=recording.rig.with_effects([rate]))

    usual, late = (forecast(one, 1200.0, 900.0) for one in (recording, acting_from(1500.0)))
    assert late.rate_factors == usual.rate_factors
    assert late.present.mean[-1].sum() > 1.1 * usual.present.mean[-1].sum()
    assert forecast(acting_from(300.0), 1500.0, 60.0).rate_factors['injector'].factor < 0.9


def test_a_moment_beyond_the_recording_is_refused(recording: Recording) -> None:
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match='last map is from 40 min'):
        study_what_if(recording, 9000.0, [], executor=pool)


@pytest.mark.parametrize(
    ('end_min', 'start', 'asked', 'expected'),
    [
        (50.0, 1500.0, None, 1500.0),
        (50.0, 1500.0, 600.0, 600.0),
        (30.0, 1500.0, None, 900.0),  # maps until 40 min show that it went on
        (None, 1500.0, None, 1800.0),
        (None, 1500.0, 4000.0, 4000.0),
        (50.0, 1500.0, 1600.0, '--horizon 1500s'),
        (30.0, 2400.0, None, 'earlier --at'),
    ],
)
def test_a_forecast_ends_with_the_experiment(
    recording: Recording,
    end_min: float | None,
    start: float,
    asked: float | None,
    expected: float | str,
) -> None:
    control = recording.rig.control
    assert control is not None
    rig = recording.rig.model_copy(
        update={'control': control.model_copy(update={'end_min': end_min})}
    )
    given = replace(recording, rig=rig)
    if isinstance(expected, str):
        with pytest.raises(InputError, match=expected):
            horizon_ahead(given, start, asked)
    else:
        assert horizon_ahead(given, start, asked) == expected


def test_a_horizon_that_ends_before_the_first_map_is_refused(recording: Recording) -> None:
    later = replace(recording, maps=recording.maps.part(1, len(recording.maps)))
    for horizon in (60.0, 200.0):
        with (
            ThreadPoolExecutor(1) as pool,
            pytest.raises(InputError, match=r'first map is from 5 min, .* give a longer --horizon'),
        ):
            study_what_if(later, 100.0, [], executor=pool, horizon=horizon)


@pytest.mark.parametrize(
    ('text', 'seconds'),
    [('35min', 2100.0), ('0.5h', 1800.0), ('2d', 172800.0), ('90s', 90.0), ('600', 600.0)],
)
def test_times_have_units(text: str, seconds: float) -> None:
    assert seconds_of(text) == seconds


@pytest.mark.parametrize('text', ['soon', '-3min', 'infh', 'nan', 'min'])
def test_other_texts_are_no_times(text: str) -> None:
    with pytest.raises(InputError, match='like 35min'):
        seconds_of(text)


def test_a_negative_time_is_named() -> None:
    with pytest.raises(InputError, match='is negative; write a number'):
        seconds_of('-3min')


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('control1=3,5', 'write 3.5 instead of 3,5'),
        ('nowell=3', "well 'nowell' is unknown"),
        ('control1', 'write WELL=ML_H'),
        ('=5', 'write WELL=ML_H'),
        ('control1=much', 'write WELL=ML_H'),
        ('control1=3@2', "concentration '2' must be from 0"),
        ('control1=3@', "concentration '' must be from 0"),
        ('control1=3@stock', "concentration 'stock' must be from 0"),
        ('5min:control1=3', 'lies before --at'),
    ],
)
def test_wrong_rates_are_refused(text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        rate_step(text, demo_scenario().rig, 600.0)


def test_a_well_injects_what_the_rig_says_or_the_user() -> None:
    rig = demo_scenario().rig
    step = rate_step('control1=5, injector=100, control3=2@0.3', rig, 600.0)
    told = {name: rate.concentration for name, rate in step.rates.items()}
    assert told == {'control1': 0.0, 'injector': 1.0, 'control3': 0.3}
    assert rate_step('injector=100@0', rig, 600.0).rates['injector'].concentration == 0.0


def test_a_well_gets_one_rate_at_a_time() -> None:
    rig = demo_scenario().rig
    steps = rate_steps(['20min:control1=5', 'control1=6', 'control3=7'], rig, 600.0)
    assert [step.start for step in steps] == [0.0, 0.0, 600.0]
    with pytest.raises(InputError, match='control1 has a rate at that time already'):
        rate_steps(['control1=5', '600s:control1=6'], rig, 600.0)


def test_a_change_may_come_later() -> None:
    step = rate_step('20min:control1=3', demo_scenario().rig, 600.0)
    assert step.start == 600.0
    assert to_ml_h(step.rates['control1'].rate) == pytest.approx(3.0)


def test_a_change_happens_when_the_user_says_although_the_state_is_older() -> None:
    rig = demo_scenario().rig
    steps = [rate_step(text, rig, 200.0) for text in ('5min:control1=3', '5min:control3=4')]
    (later,) = later_steps(steps, 20.0)
    assert later.start == pytest.approx(300.0 - 180.0)
    assert set(later.rates) == {'control1', 'control3'}
    (now,) = later_steps([RateStep(0.0, {})], -0.5)
    assert now.start == 0.0


def test_a_moment_between_photographs_begins_at_the_one_before(recording: Recording) -> None:
    step = rate_step('420s:control1=300', recording.rig, 400.0)
    told: list[str] = []
    with ThreadPoolExecutor(2) as pool:
        found = study_what_if(
            recording,
            400.0,
            [step],
            cells=135,
            executor=pool,
            horizon=60.0,
            siblings=24,
            objected=told.append,
        )
    assert found.start == 300.0
    assert [step.start for step in found.proposed.plan] == [0.0, 120.0]
    assert found.proposed.times[-1] == pytest.approx(160.0)
    assert tuple(told) == found.objections


@pytest.mark.parametrize(
    ('rates', 'horizon', 'complaint'),
    [
        ('control1=1e9', 60.0, 'is not plausible'),
        ('control1=300', 1e9, 'horizon'),
        ('20min:control1=300', 60.0, 'beyond the horizon'),
    ],
)
def test_a_study_without_end_is_refused_before_the_work(
    recording: Recording, rates: str, horizon: float, complaint: str
) -> None:
    learnt: list[int] = []
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match=complaint):
        study_what_if(
            recording,
            600.0,
            [rate_step(rates, recording.rig, 600.0)],
            cells=589,
            executor=pool,
            horizon=horizon,
            learnt=lambda done, _: learnt.append(done),
        )
    assert learnt == []
