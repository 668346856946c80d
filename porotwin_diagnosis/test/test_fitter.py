"""Fits: free-running, to the first part, evaluated on the last."""

from dataclasses import dataclass

import numpy as np
import pytest
from diagnosis_examples import at_factor, candidate, fitted, recorded, sample_of

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.polishing import polished
from porotwin_diagnosis.search.ranking import feasible


def fine_fitter(recording):
    return Fitter([Forward(sample_of(recording), refinement=2, point_spread_width=0.55)])


def test_porosity_is_found_in_data_of_another_simulator(fitter, porosity):
    fit = fitter.fit((porosity,))
    null = fitter.evaluate((), np.zeros(0))
    assert fit.effects[0].parameters['factor'] == pytest.approx(0.88, abs=0.012)
    assert fit.held_out_misfit < 0.45 * null.held_out_misfit
    fit = fitter.with_covariance(fit)
    assert 0 < np.sqrt(fit.covariance[0, 0]) * 0.015 < 0.02


def test_held_out_frames_have_no_part_in_a_fit(fitter, denser_sand, porosity):
    sample = sample_of(denser_sand)
    sample.observed[sample.fitted_frames :] = 0.5
    spoiled = Fitter([Forward(sample, point_spread_width=0.3)])
    a, b = fitter.fit((porosity,)), spoiled.fit((porosity,))
    assert np.allclose(a.scaled_parameters, b.scaled_parameters)
    assert b.held_out_misfit > 3 * a.held_out_misfit


def test_different_effects_have_distant_predictions(fitter):
    right, wrong = fitted(fitter, 'porosity'), fitted(fitter, 'saturation')
    assert fitter.distance(right, wrong) > 0.5
    assert fitter.distance(wrong, right) == pytest.approx(fitter.distance(right, wrong))
    assert fitter.distance(right, right) == 0.0


def test_the_model_without_effects_leaves_only_the_noise_of_a_quiet_recording(quiet):
    null = fine_fitter(quiet).evaluate((), np.zeros(0))
    assert null.fitted_misfit < 1.2
    assert null.held_out_misfit < 1.2


def test_a_shifted_and_rotated_picture_is_found_in_its_narrow_valley(tmp_path):
    truth = {'dx': 0.006, 'dz': -0.008, 'rotation': -0.02, 'scale': 1.01}
    effect = EffectDescription(name='registration', parameters=truth)
    sample = sample_of(recorded(tmp_path / 'recording', effect))
    fitter = Fitter([Forward(sample, point_spread_width=0.3)])
    registration = candidate([sample], 'registration')
    true_parameters = [each.scaled(truth[each.name]) for each in registration.parameters]
    true = fitter.evaluate((registration,), np.array(true_parameters))
    assert fitter.fit((registration,)).fitted_misfit <= 1.01 * true.fitted_misfit


def test_a_true_model_leaves_little_beyond_the_noise_and_a_wrong_one_much(denser_sand, porosity):
    fine = fine_fitter(denser_sand)
    right = fine.evaluate((porosity,), at_factor(porosity, 0.88))
    wrong = fine.evaluate((porosity,), at_factor(porosity, 0.92))
    misfit = np.hypot(right.fitted_misfit, right.held_out_misfit)
    assert misfit < 2.5 * np.hypot(*right.noise_misfit)
    assert np.hypot(wrong.fitted_misfit, wrong.held_out_misfit) > 2 * misfit


def test_slopes_from_a_later_parameter_on_equal_those_of_all(fitter, porosity):
    members = (porosity, candidate(fitter.samples, 'saturation'))
    scaled = np.array([-8.0, 0.5])
    every = fitter.responses(members, scaled)[0]
    later = fitter.responses(members, scaled, first=1)[0]
    assert len(later) == 1
    np.testing.assert_array_equal(every[1:], later)


def test_an_absent_effect_is_not_simulated(fitter, porosity):
    forward, depth = fitter.forwards[0], candidate(fitter.samples, 'depth')
    fitter.responses((porosity,), np.zeros(1))
    before = forward.simulations
    fitter.responses((porosity, depth), np.zeros(2), first=1)
    assert forward.simulations == before + 1


@dataclass(frozen=True, eq=False)
class RefusingForward(Forward):
    """A forward model that refuses sand with a porosity below a factor."""

    least_factor: float = 0.0

    def maps(self, effects, *, fitted_only=False):
        for effect in effects:
            if effect.name == 'porosity' and effect.parameters['factor'] < self.least_factor:
                raise InputError('porosity: too dense to run')
        return super().maps(effects, fitted_only=fitted_only)


def test_a_model_that_cannot_run_ends_neither_a_fit_nor_its_derivatives(denser_sand, porosity):
    least = -2.0
    factor = porosity.parameters[0].value(least)
    forward = RefusingForward(sample_of(denser_sand), least_factor=factor, point_spread_width=0.3)
    fitter = Fitter([forward])
    stopped = fitter.fit((porosity,))
    assert stopped.is_feasible
    assert least <= stopped.scaled_parameters[0] < 0.0, 'as far as the model goes'
    assert not fitter.fit((porosity,), start=np.array([least - 1.0])).is_feasible
    at_the_limit = fitter.evaluate((porosity,), np.array([least]))
    assert polished(fitter, at_the_limit, fitter).is_feasible
    screened = [at_the_limit, fitter.evaluate((porosity,), np.array([least - 1.0]))]
    assert feasible(screened) == [at_the_limit]
