"""Fluxes on faces: refinement and its adjoint."""

import numpy as np

from porotwin_solver.coefficients.face_field import FaceField


def test_refined_fluxes_share_the_divergence_of_a_cell_equally() -> None:
    rng = np.random.default_rng(6)
    coarse = FaceField(rng.normal(size=(5, 8)), rng.normal(size=(6, 7)))
    fine = coarse.refined(3)
    expected = np.repeat(np.repeat(coarse.divergence(), 3, axis=0), 3, axis=1) / 9.0
    np.testing.assert_allclose(fine.divergence(), expected, atol=1e-14)
    through = fine.x[:, ::3].reshape(5, 3, 8).sum(axis=1)
    np.testing.assert_allclose(through, coarse.x, atol=1e-14)


def test_refinement_and_its_adjoint_pass_the_dot_product_test() -> None:
    rng = np.random.default_rng(7)
    coarse = FaceField(rng.normal(size=(5, 8)), rng.normal(size=(6, 7)))
    bar = FaceField(rng.normal(size=(15, 22)), rng.normal(size=(16, 21)))
    fine, back = coarse.refined(3), bar.refined_adjoint(3)
    forward = np.vdot(bar.x, fine.x) + np.vdot(bar.z, fine.z)
    backward = np.vdot(back.x, coarse.x) + np.vdot(back.z, coarse.z)
    np.testing.assert_allclose(backward, forward, rtol=1e-12)


def test_addition_and_multiplication_act_on_every_face() -> None:
    rng = np.random.default_rng(8)
    one = FaceField(rng.normal(size=(5, 8)), rng.normal(size=(6, 7)))
    result = one + one * 2.0
    np.testing.assert_allclose(result.x, 3.0 * one.x)
    np.testing.assert_allclose((one * one).z, one.z**2)
