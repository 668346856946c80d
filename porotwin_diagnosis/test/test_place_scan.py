"""The scan for the place of a leak."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded, sample_of

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Boundaries, EffectDescription
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.place_scan import explained_part, promising_starts, sized_trials_at
from porotwin_diagnosis.thresholds import BEAM


def test_a_leak_within_the_plume_is_found_at_its_place(tmp_path):
    """Within the plume, water that enters makes a hole, and water that leaves does not."""
    leak = EffectDescription(name='leak', parameters={'x': 0.23, 'z': 0.3, 'rate': -22.0})
    sample = sample_of(recorded(tmp_path / 'recording', leak))
    starts = promising_starts([Forward(sample)], 'leak')
    assert len(starts) == BEAM
    start = starts[0].described(starts[0].first).parameters
    assert np.hypot(float(start['x']) - 0.23, float(start['z']) - 0.3) < 0.06
    assert -40.0 < float(start['rate']) < -10.0


def test_a_trial_explains_what_its_strongest_start_does():
    """A far place would explain all at six times the strength that a response is linear for."""
    residual = np.array([6.0, 0.0])
    far, near = np.array([1.0, 0.0]), np.array([3.0, 0.5])
    assert explained_part(far, residual, (0.0, 6.0)) == (pytest.approx(36.0), pytest.approx(6.0))
    assert explained_part(far, residual, (0.0, 3.0)) == (pytest.approx(27.0), 3.0)
    assert explained_part(near, residual, (0.0, 3.0))[0] > 27.0
    assert explained_part(-far, residual, (0.0, 3.0)) == (0.0, 0.0)


def test_a_rig_at_rest_sets_no_scale_for_a_leak(quiet):
    with pytest.raises(InputError, match='no pump ever runs'):
        resting = replace(sample_of(quiet), schedule=Schedule(()))
        promising_starts([Forward(resting)], 'leak')


def test_a_rig_that_is_closed_on_all_sides_has_no_leak_to_try(quiet):
    sample = sample_of(quiet)
    place = (0.3, 0.2)
    assert sized_trials_at(sample, 'leak', place)
    sides = Boundaries(top='closed', bottom='closed', left='closed', right='closed')
    closed = replace(sample, rig=sample.rig.model_copy(update={'boundaries': sides}))
    assert not sized_trials_at(closed, 'leak', place)
    assert sized_trials_at(closed, 'heterogeneity', place)
