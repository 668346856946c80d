"""Close rivals are compared on each other's corrections; groups that look the same add up."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from diagnosis_examples import fit_of, sample_of

from porotwin_diagnosis.search.close_rivals import compared_rivals
from porotwin_diagnosis.search.levels import make_levels
from porotwin_diagnosis.search.prior import Prior
from porotwin_diagnosis.search.ranking import swallowed_misfit

NULL = fit_of(misfit=6.0)


@dataclass(frozen=True)
class CorrectedAt:
    """Levels on which the fit that they are corrected at leaves 0.05 more than its rivals do."""

    best: str = ''

    @property
    def judging(self):
        return self

    def corrected_at(self, fit):
        return CorrectedAt(fit.label)

    def evaluated_again(self, fit):
        misfit = 0.45 if fit.label == self.best else 0.40
        return replace(fit_of(fit.label, misfit=misfit), unshared_misfit=(misfit, misfit))

    def distance(self, one, other):
        alike = {'porosity', 'retardation'}
        return 0.01 if {one.label, other.label} <= alike else 0.3


def test_the_most_probable_group_of_close_rivals_or_an_earlier_finding_comes_first():
    singles = [fit_of('depth', misfit=0.41), fit_of('porosity', misfit=0.45)]
    singles += [fit_of('retardation', misfit=0.46), fit_of('leak', misfit=3.0)]
    levels, compared = compared_rivals(CorrectedAt(), singles, NULL)
    assert [fit.label for fit in compared] == ['porosity', 'retardation', 'depth', 'leak']
    assert levels.best == 'porosity'
    assert {round(fit.fitted_misfit, 6) for fit in compared[:3]} == {round(1.25 / 3, 6)}
    believed = Prior({'retardation': 0.9, 'leak': 0.1})
    levels, compared = compared_rivals(CorrectedAt(), singles, NULL, believed)
    assert [fit.label for fit in compared] == ['retardation', 'porosity', 'depth', 'leak']
    assert levels.best == 'retardation'


def test_rivals_on_equal_terms_swallow_nothing_without_shared_errors():
    singles = [fit_of('depth', misfit=0.41), fit_of('porosity', misfit=0.45)]
    _, compared = compared_rivals(CorrectedAt(), singles, NULL)
    assert [swallowed_misfit(fit) for fit in compared] == [0.0, 0.0]


def test_of_two_rivals_that_fit_alike_the_simpler_one_comes_first():
    shift = replace(fit_of('registration', misfit=0.41), scaled_parameters=np.ones(4))
    singles = [shift, fit_of('saturation', misfit=0.42)]
    _, compared = compared_rivals(CorrectedAt(), singles, NULL)
    assert [fit.label for fit in compared] == ['saturation', 'registration']


@pytest.mark.parametrize('second', [fit_of('leak', misfit=1.2), fit_of('rate', misfit=5.0)])
def test_without_a_close_rival_nothing_is_simulated(quiet, second):
    levels = make_levels([sample_of(quiet)], progress=lambda _stage, _share: None)
    singles = [fit_of('porosity', misfit=0.4), second]
    assert compared_rivals(levels, singles, NULL) == (levels, singles)
    assert levels.simulations == 0


def test_fits_that_do_not_suffice_are_no_rivals(quiet):
    levels = make_levels([sample_of(quiet)], progress=lambda _stage, _share: None)
    singles = [fit_of('porosity', misfit=2.0), fit_of('rate', misfit=2.0)]
    singles = [replace(fit, fitted_error=0.2) for fit in singles]
    assert compared_rivals(levels, singles, NULL) == (levels, singles)
