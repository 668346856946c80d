"""The library of candidates for a rig."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import candidate, sample_of

from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Boundaries
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import library, pumping_wells


@pytest.fixture(scope='module')
def sample(quiet):
    return sample_of(quiet)


def test_a_closed_rig_has_no_leak_but_wrong_rates(sample):
    closed = sample.rig.model_copy(update={'boundaries': Boundaries(top='closed')})
    effects = {each.effect for each in library([replace(sample, rig=closed)])}
    assert 'leak' not in effects
    assert {'rate', 'heterogeneity'} <= effects


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
