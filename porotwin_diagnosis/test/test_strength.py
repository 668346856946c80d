"""The smallest strengths that would have been visible in a recording."""

from dataclasses import replace

import pytest

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.strength import smallest_strengths
from porotwin_diagnosis.data.sample import coarsened, read_sample
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import library
from porotwin_recording.experiment.recording import open_recording


@pytest.fixture(scope='module')
def sample(quiet):
    return coarsened(read_sample(open_recording(quiet)), 2)


def test_a_weaker_effect_shows_where_less_noise_is(sample):
    def least(noisier):
        noise = replace(sample.noise, grain=noisier * sample.noise.grain)
        noisy = replace(sample, noise=noise)
        return smallest_strengths(Fitter([Forward(noisy)]))

    assert least(1.0)['porosity'].value < least(8.0)['porosity'].value


def test_an_effect_of_the_rig_description_is_where_a_deviation_starts(sample):
    """A corrected twin is diagnosed again: less or more of the same effect would be visible."""
    known = (
        EffectDescription(name='buoyancy', parameters={'density_difference': 0.8}),
        EffectDescription(
            name='dispersion',
            parameters={'longitudinal_dispersivity': 2e-3, 'transverse_dispersivity': 2e-4},
        ),
    )
    corrected = replace(sample, rig=sample.rig.model_copy(update={'effects': known}))
    for candidate in library([corrected]):
        if candidate.label in ('buoyancy', 'dispersion'):
            described = candidate.described(candidate.first).parameters
            for name, value in known[candidate.effect != 'buoyancy'].parameters.items():
                assert described[name] == pytest.approx(value)
    plain, again = (smallest_strengths(Fitter([Forward(s)])) for s in (sample, corrected))
    assert again['buoyancy'].value == pytest.approx(plain['buoyancy'].value, rel=0.5)
    assert again['dispersion'].parameter == 'longitudinal_dispersivity'
