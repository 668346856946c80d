"""The last refinement, and the parameters that judge the held-out frames."""

import numpy as np
import pytest
from diagnosis_examples import at_factor, sample_of

from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.polishing import held_out_parameters, polished

TRUE_FACTOR = 0.88


def test_a_fit_is_polished_with_the_slopes_of_coarser_cells(fitter, denser_sand, porosity):
    fine = Fitter([Forward(sample_of(denser_sand), refinement=2, point_spread_width=0.55)])
    off = fine.evaluate((porosity,), at_factor(porosity, 0.93))
    fit = polished(fine, off, fitter)
    assert fit.fitted_misfit < 0.4 * off.fitted_misfit
    assert fit.effects[0].parameters['factor'] == pytest.approx(TRUE_FACTOR, abs=0.01)


def test_held_out_frames_are_judged_with_parameters_near_the_fitted_ones(fitter, porosity):
    off = at_factor(porosity, 0.9)
    suited = held_out_parameters(fitter, fitter.evaluate((porosity,), off), fitter)
    assert TRUE_FACTOR < porosity.parameters[0].value(suited[0]) < 0.897, 'moving has its price'


def test_only_a_lower_misfit_of_the_held_out_frames_counts(fitter, porosity):
    off, true = at_factor(porosity, 0.9), at_factor(porosity, TRUE_FACTOR)
    plain = fitter.evaluate((porosity,), off)
    judged = fitter.evaluate((porosity,), off, held_out_parameters=true)
    assert judged.held_out_misfit < 0.7 * plain.held_out_misfit
    assert judged.fitted_misfit == plain.fitted_misfit
    assert np.array_equal(judged.scaled_parameters, off)
    assert fitter.evaluated_again(judged).held_out_misfit == judged.held_out_misfit
    worse = fitter.evaluate((porosity,), true, held_out_parameters=off)
    assert worse.held_out_parameters is None


def test_what_the_fitted_frames_lose_is_added_to_the_held_out_misfit(fitter, denser_sand, porosity):
    """A move that suits the held-out frames and contradicts the fitted ones explains nothing."""
    sample = sample_of(denser_sand)
    shown = Forward(sample).maps(())
    sample.observed[sample.fitted_frames :] = shown[sample.fitted_frames :]
    turned = Fitter([Forward(sample, point_spread_width=0.3)])
    true, none = at_factor(porosity, TRUE_FACTOR), at_factor(porosity, 1.0)
    plain = turned.evaluate((porosity,), true)
    moved = turned.evaluate((porosity,), none)
    judged = turned.evaluate((porosity,), true, held_out_parameters=none)
    lost = np.sqrt(moved.fitted_misfit**2 - plain.fitted_misfit**2)
    assert moved.held_out_misfit < 0.5 * plain.held_out_misfit
    assert judged.held_out_misfit >= min(lost, plain.held_out_misfit)
