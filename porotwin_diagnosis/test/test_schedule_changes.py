"""Changes of a schedule: volumes, times and balances are kept."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import SMALL, schedule

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.advice.schedule_changes import SCHEDULE_CHANGES
from porotwin_diagnosis.data.sample import coarsened, read_sample
from porotwin_recording.experiment.recording import open_recording


@pytest.fixture(scope='module')
def sample(quiet):
    return coarsened(read_sample(open_recording(quiet)), 2)


def changed(name):
    """Return the function that applies the change `name`."""
    return next(change.apply for change in SCHEDULE_CHANGES if change.name == name)


def volume(sample, *, with_tracer=False):
    """Return the volume [m^3] that all wells inject, or the volume of tracer."""
    return sum(
        (high - low)
        * sum(
            rate.rate * (rate.concentration if with_tracer else 1.0)
            for rate in rates.values()
            if rate.rate > 0
        )
        for low, high, rates in sample.schedule.intervals(sample.start, sample.end)
    )


@pytest.mark.parametrize(('name', 'factor'), [('half rates', 0.5), ('double rates', 2.0)])
def test_other_rates_pump_the_same_volume(sample, name, factor):
    other = changed(name)(sample)
    assert other.duration == pytest.approx(sample.duration / factor)
    assert volume(other) == pytest.approx(volume(sample))
    assert np.allclose(other.times, sample.times / factor)


def test_nothing_is_pumped_during_the_rest(sample):
    other = changed('rest')(sample)
    rates = other.schedule.at(sample.start + 0.41 * sample.duration)
    assert all(rate.rate == 0.0 for rate in rates.values())
    assert 0.0 < volume(other) < volume(sample)


def test_a_chase_replaces_tracer_by_water(sample):
    other = changed('water after tracer')(sample)
    assert volume(other) == pytest.approx(volume(sample))
    assert 0.0 < volume(other, with_tracer=True) < volume(sample, with_tracer=True)


def test_one_well_at_a_time_lets_one_well_pump_and_keeps_a_closed_rig_in_balance(sample):
    change = changed('one well at a time')
    both = change(sample).schedule
    for low, _, rates in both.intervals(sample.start, sample.end):
        assert sum(rate.rate != 0.0 for rate in rates.values()) == 1, low
    alone = Schedule(sample.schedule.rows[:1])
    joined = change(replace(sample, schedule=alone)).schedule
    assert joined.wells == ('injector', 'control1')  # the next one
    shut = SMALL.model_copy(
        update={'boundaries': SMALL.boundaries.model_copy(update={'top': 'closed'})}
    )
    forth = [ScheduleRow(t, 'injector', WellRate(rate)) for t, rate in ((0, 2e-7), (60, -1e-7))]
    back = [ScheduleRow(t, 'producer', WellRate(rate)) for t, rate in ((0, -1e-7), (60, 2e-7))]
    to_and_fro = Schedule((*forth, *back))
    assert change(replace(sample, rig=shut, schedule=to_and_fro)) is None, 'nobody produces'
    closed = change(replace(sample, rig=shut, schedule=schedule())).schedule
    for _, _, rates in closed.intervals(sample.start, sample.end):
        assert sum(rate.rate for rate in rates.values()) == pytest.approx(0.0, abs=1e-15)
        assert sum(rate.rate > 0.0 for rate in rates.values()) == 1
