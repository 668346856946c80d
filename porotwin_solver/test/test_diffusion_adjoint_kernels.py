"""The adjoint of diffusion: the dot-product test."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_solver.adjoint.diffusion_adjoint_kernels import exchange_adjoint
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.transport.diffusion import diffuse, dispersive_exchanges
from porotwin_solver.transport.local_time_steps import tape_length


def test_diffusion_and_its_adjoint_pass_the_dot_product_test(rig) -> None:
    """<bar, D c> = <D^T bar, c>, to round-off: diffusion D is linear in the concentration."""
    physics = replace(
        nominal_physics(rig, rig.grid(21, 15)),
        longitudinal_dispersivity=0.006,
        transverse_dispersivity=0.0005,
    )
    rng = np.random.default_rng(8)
    flux = FaceField(rng.normal(size=(15, 22)) * 1e-6, rng.normal(size=(16, 21)) * 1e-6)
    exchanges = dispersive_exchanges(physics, flux, 60.0)
    start, bar = rng.normal(size=(15, 21)), rng.normal(size=(15, 21))
    after, tape = start.copy(), np.empty(tape_length(exchanges.levels))
    diffuse(after, physics.storage, exchanges, tape=tape)
    forward, back = np.vdot(bar, after), bar.copy()
    exchange_adjoint(
        after.ravel(),
        back.ravel(),
        physics.storage.ravel(),
        exchanges,
        tape,
        np.zeros_like(exchanges.weight),
        np.zeros(start.size),
    )
    assert np.vdot(back, start) == pytest.approx(forward, rel=1e-11)
