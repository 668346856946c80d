"""The forward model: simulations, their memory, and the multifidelity correction."""

import numpy as np
import pytest
from diagnosis_examples import sample_of

from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.forward import Forward, whitened_residuals


@pytest.fixture(scope='module')
def forward(quiet):
    return Forward(sample_of(quiet), refinement=1)


@pytest.fixture(scope='module')
def finer(forward):
    return Forward(forward.sample, refinement=2)


def effect(name, **parameters):
    return EffectDescription(name=name, parameters=parameters)


def test_a_repeated_simulation_is_not_made_again(quiet):
    forward = Forward(sample_of(quiet))
    maps = forward.maps(())
    assert forward.simulations == 1
    np.testing.assert_array_equal(
        forward.maps((), fitted_only=True), maps[: forward.sample.fitted_frames]
    )
    forward.maps((effect('saturation', exponent=0.8),))
    assert forward.simulations == 1
    forward.maps((effect('porosity', factor=0.9),), fitted_only=True)
    assert forward.simulations == 2
    assert len(forward.maps((effect('porosity', factor=0.9),))) == len(maps)
    assert forward.simulations == 2  # the same one with more frames


def test_retardation_and_porosity_look_the_same(forward):
    slow, porous = effect('retardation', retardation_factor=1.1), effect('porosity', factor=1.1)
    maps = [forward.maps((each,)) for each in (slow, porous)]
    assert np.abs(maps[0] - maps[1]).max() < 1e-3


def test_a_corrected_model_equals_the_finer_one_where_it_was_corrected(forward, finer):
    porosity = (effect('porosity', factor=0.95),)
    corrected = forward.corrected_by(finer, porosity)
    np.testing.assert_allclose(corrected.maps(porosity), finer.maps(porosity), atol=1e-6)


def test_a_corrected_model_is_closer_to_the_finer_one_nearby(forward, finer):
    corrected = forward.corrected_by(finer)
    nearby = (effect('porosity', factor=0.99),)
    errors = [np.linalg.norm(f.maps(nearby) - finer.maps(nearby)) for f in (corrected, forward)]
    assert errors[0] < 0.7 * errors[1]


def test_a_correction_makes_another_model_that_shares_the_simulations(forward, finer):
    plain = forward.maps(())
    corrected = forward.corrected_by(finer)
    again = corrected.corrected_by(finer)
    np.testing.assert_array_equal(forward.maps(()), plain)
    np.testing.assert_array_equal(again.correction, corrected.correction)
    before = forward.simulations
    corrected.maps(())
    corrected.uncorrected().maps(())
    assert forward.simulations == corrected.simulations == before


def test_an_extrapolation_multiplies_the_correction(forward, finer):
    once, more = (forward.corrected_by(finer, extrapolation=factor) for factor in (1.0, 1.6))
    np.testing.assert_allclose(more.correction, 1.6 * once.correction)


def test_residuals_come_for_every_recording(forward):
    frames = forward.sample.fitted_frames
    residuals = whitened_residuals([forward] * 2, (), fitted_only=True)
    assert [residual.shape[0] for residual in residuals] == [frames, frames]
    np.testing.assert_array_equal(*residuals)
