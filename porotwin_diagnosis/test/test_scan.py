"""The search for the place of a leak or a zone."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_examples import recorded

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_core.wells import Schedule
from porotwin_diagnosis.data.sample import read_sample
from porotwin_diagnosis.model.candidate import library
from porotwin_diagnosis.model.fit import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.search.scan import starts
from porotwin_recording.recording import open_recording


def test_a_leak_within_the_plume_is_looked_for_where_it_is(tmp_path):
    """Water that enters the plume makes a hole in it; water that is lost does not."""
    leak = EffectDescription(name='leak', parameters={'x': 0.23, 'z': 0.3, 'rate': -22.0})
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', leak)))
    first = starts([Forward(sample)], 'leak')[0]
    start = first.described(first.first).parameters
    assert np.hypot(float(start['x']) - 0.23, float(start['z']) - 0.3) < 0.06
    assert -40.0 < float(start['rate']) < -10.0


def test_a_leak_is_found_beside_an_effect_whose_parameters_adapt(tmp_path):
    """A shifted picture hides the place of the leak, and a fit without the leak imitates both."""
    leak = EffectDescription(name='leak', parameters={'x': 0.16, 'z': 0.3, 'rate': -40.0})
    moved = EffectDescription(name='registration', parameters={'dx': 0.006, 'dz': -0.004})
    sample = read_sample(open_recording(recorded(tmp_path / 'recording', leak, moved)))
    registration = next(c for c in library([sample]) if c.effect == 'registration')
    fitter = Fitter([Forward(sample)])
    imitating = fitter.fit((registration,))
    first = starts(fitter.forwards, 'leak', beside=imitating)[0]
    start = first.described(first.first).parameters
    assert np.hypot(float(start['x']) - 0.16, float(start['z']) - 0.3) < 0.06
    assert -60.0 < float(start['rate']) < -15.0


def test_a_rig_at_rest_offers_no_size_for_a_leak(quiet):
    sample = read_sample(open_recording(quiet))
    with pytest.raises(InputError, match='no pump ever runs'):
        starts([Forward(replace(sample, schedule=Schedule(())))], 'leak')
