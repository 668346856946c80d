"""Interpolation to a finer grid and averaging back."""

import numpy as np
from solver_cases import rough_map

from porotwin_solver.coefficients.refinement import coarsen, coarsen_adjoint, refine


def test_refinement_and_averaging_return_the_map() -> None:
    coarse = rough_map((11, 14), 6)
    fine = refine(coarse, (33, 42))
    np.testing.assert_allclose(coarsen(fine, (11, 14)), coarse, atol=1e-15)
    assert fine.min() >= 0.0
    assert fine.max() <= 1.0


def test_averaging_and_its_adjoint_pass_the_dot_product_test() -> None:
    rng = np.random.default_rng(3)
    fine, bar = rng.normal(size=(12, 21)), rng.normal(size=(4, 7))
    forward = np.vdot(bar, coarsen(fine, (4, 7)))
    np.testing.assert_allclose(np.vdot(coarsen_adjoint(bar, (12, 21)), fine), forward, rtol=1e-13)
