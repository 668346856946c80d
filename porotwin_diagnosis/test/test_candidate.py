"""Candidates: scaled parameters, and the library for a rig."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import candidate, sample_of

from porotwin_core.rig import Boundaries
from porotwin_core.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.model.candidate import FitParameter, library, pumping_wells
from porotwin_diagnosis.model.forward import Forward


@pytest.fixture(scope='module')
def sample(quiet):
    return sample_of(quiet)


def test_scaled_parameters_and_values_are_inverse():
    for parameter in (
        FitParameter('a', 'm', 2.0, 0.3),
        FitParameter('b', '-', 2.0, 0.3, low=0.1, log=True),
    ):
        assert parameter.value(parameter.scaled(3.7)) == pytest.approx(3.7)
    assert FitParameter('c', '-', 1.0, 0.1, low=1.0).value(-5.0) == 1.0


def test_a_closed_rig_has_no_leak_and_no_wrong_rate(sample):
    closed = sample.rig.model_copy(update={'boundaries': Boundaries(top='closed')})
    effects = {each.effect for each in library([replace(sample, rig=closed)])}
    assert effects.isdisjoint({'leak', 'rate'})
    assert 'heterogeneity' in effects


def test_a_well_beside_a_wall_may_stay_in_place(sample):
    well = sample.rig.wells['injector']
    high = well.model_copy(update={'z_m': sample.rig.height_m - 0.5 * well.radius_m})
    rig = sample.rig.model_copy(update={'wells': {**sample.rig.wells, 'injector': high}})
    shifts = candidate([replace(sample, rig=rig)], 'well_position injector')
    assert shifts.parameters[1].range == (pytest.approx(shifts.parameters[1].range[0]), 0.0)
    assert shifts.described((0.0, 0.0)).parameters['dz'] == 0.0


def test_a_listed_well_that_rests_is_not_pumping(sample):
    rest = ScheduleRow(0.0, 'control3', WellRate(0.0, 0.0))
    resting = replace(sample, schedule=Schedule((*sample.schedule.rows, rest)))
    assert 'control3' not in pumping_wells([resting])


def test_absent_effects_change_nothing(sample):
    forward = Forward(sample)
    without = forward.maps(())
    absent = set()
    for each in library([sample]):
        neutral = (0.0,) * len(each.parameters)
        if each.is_absent(neutral):
            absent.add(each.effect)
            np.testing.assert_array_equal(forward.maps((each.described(neutral),)), without)
    assert {'porosity', 'clock', 'rate', 'buoyancy'} < absent
