"""The record of a fit."""

import numpy as np
from diagnosis_examples import fit_of

from porotwin_diagnosis.model.fit import Fit, effects_at, infeasible_fit
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter

PAIR = (
    Candidate('porosity', (FitParameter('factor', '-', 1.0, 0.1),)),
    Candidate(
        'well_position',
        (FitParameter('dx', 'm', 0.0, 0.01), FitParameter('dz', 'm', 0.0, 0.01)),
        {'well': 'injector'},
    ),
)


def test_every_member_takes_its_own_parameters():
    porosity, position = effects_at(PAIR, np.array([2.0, 1.0, -3.0]))
    assert porosity.parameters == {'factor': 1.2}
    assert position.parameters == {'well': 'injector', 'dx': 0.01, 'dz': -0.03}


def test_standard_deviations_are_roots_of_the_covariance():
    scaled, covariance = np.array([2.0, 1.0, -3.0]), np.diag([4.0, 9.0, -1.0])
    fit = Fit(PAIR, scaled, 1.0, 1.0, 0.1, 0.1, covariance)
    porosity, position = fit.member_parameters
    assert (porosity.scaled.tolist(), porosity.deviations.tolist()) == ([2.0], [2.0])
    assert (position.scaled.tolist(), position.deviations.tolist()) == ([1.0, -3.0], [3.0, 0.0])
    assert position.candidate is PAIR[1]


def test_a_fit_is_labelled_by_its_members():
    assert infeasible_fit(PAIR, np.zeros(3)).label == 'porosity + well_position injector'
    assert fit_of(misfit=1.0).label == 'none'


def test_a_fit_with_which_the_model_cannot_run_is_infeasible():
    assert not infeasible_fit(PAIR, np.zeros(3)).is_feasible
    assert fit_of('porosity', misfit=1.0).is_feasible
