"""The adjoint of diffusion: the dot-product test."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_solver.adjoint.diffusion_adjoint_kernels import (
    exchange_adjoint,
    exchange_along_lines_adjoint,
)
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.transport.diffusion import diffuse, dispersive_exchanges
from porotwin_solver.transport.line_kernels import Lines, exchange_along_lines, make_lines


def dispersing(rig, along: float, across: float, *, duration: float):
    """Return a physics with these dispersivities, a generator, and exchanges in a random flow."""
    physics = replace(
        nominal_physics(rig, rig.grid(21, 15)),
        longitudinal_dispersivity=along,
        transverse_dispersivity=across,
    )
    rng = np.random.default_rng(8)
    flux = FaceField(rng.normal(size=(15, 22)) * 1e-6, rng.normal(size=(16, 21)) * 1e-6)
    return physics, rng, dispersive_exchanges(physics, flux, duration)


def test_diffusion_and_its_adjoint_pass_the_dot_product_test(rig) -> None:
    """<bar, D c> = <D^T bar, c>, to round-off: diffusion D is linear in the concentration."""
    physics, rng, exchanges = dispersing(rig, 0.006, 0.0005, duration=60.0)
    start, bar = rng.normal(size=(15, 21)), rng.normal(size=(15, 21))
    after, tape = start.copy(), np.empty(exchanges.tape_length)
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


def test_exchange_along_lines_and_its_adjoint_pass_the_dot_product_test(rig) -> None:
    """The derivatives by concentrations, weights and storage, with parts of either kind of step."""
    physics, rng, exchanges = dispersing(rig, 0.1, 0.01, duration=30.0)
    lines = exchanges.lines
    assert lines is not None
    assert (lines.before > 0.0).any()
    assert ((lines.before == 0.0) & (lines.after > 0.0)).any()
    start, bar = rng.normal(size=(15, 21)), rng.normal(size=(15, 21))
    storage, weight = physics.storage.ravel(), exchanges.weight
    length = 30.0 / lines.steps

    def after(weights, storages, tape):
        made = make_lines(exchanges.start, exchanges.other, weights, storages, length)
        result = start.ravel().copy()
        exchange_along_lines(result, storages, Lines(lines.steps, *made), tape)
        return result

    tape = np.empty(exchanges.tape_length)
    result = after(weight, storage, tape)
    back, weight_bar, storage_bar = bar.copy(), np.zeros_like(weight), np.zeros(start.size)
    last = result.copy()
    exchange_along_lines_adjoint(
        last, back.ravel(), storage, lines, length, tape, weight_bar, storage_bar
    )
    np.testing.assert_array_equal(last, start.ravel())
    assert np.vdot(back, start) == pytest.approx(np.vdot(bar, result), rel=1e-11)
    by_weight = weight * rng.uniform(-1e-5, 1e-5, weight.size)
    by_storage = storage * rng.uniform(-1e-5, 1e-5, storage.size)
    none = np.empty(0)
    more = after(weight + by_weight, storage + by_storage, none)
    less = after(weight - by_weight, storage - by_storage, none)
    found = np.vdot(weight_bar, by_weight) + np.vdot(storage_bar, by_storage)
    assert found == pytest.approx(0.5 * np.vdot(bar.ravel(), more - less), rel=1e-6)
