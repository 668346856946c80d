"""The bounds of the derivatives by a state."""

import numpy as np
import pytest
from solver_cases import rough_map

from porotwin_core.basis.errors import InputError
from porotwin_solver.adjoint.adjoint_state import OVERSHOOT, AdjointState, refuse_not_finite
from porotwin_solver.adjoint.step_adjoint import step_adjoint
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.transport.scheme import Scheme


@pytest.mark.parametrize('scheme', list(Scheme))
def test_a_step_moves_derivatives_back_to_their_bounds(rig, rates, scheme) -> None:
    engine = Engine(nominal_physics(rig, rig.grid(31, 19)), scheme=scheme)
    shape = engine.grid.shape
    rough = State.equilibrium(rough_map(shape, 5))
    bar = AdjointState.equilibrium(np.zeros(shape))
    bar.add_by_mean(engine, engine.physics.storage * rough_map(shape, 6))
    bar.mobile[:] *= np.random.default_rng(7).choice([-1e30, 1.0, 1e30], shape)  # as after kinks
    for _ in range(5):
        step_adjoint(engine, rough, rates, 60.0, bar)
        furthest = float(np.abs(bar.mobile / engine.storage).max())
        assert furthest < 5.0 * (1.0 + OVERSHOOT)  # the last substep's own
    assert (bar.lowest, bar.highest) == (0.0, pytest.approx(1.0))


def test_immobile_water_shares_the_bounds(rig) -> None:
    physics = nominal_physics(rig, rig.grid(5, 3))
    engine = Engine(physics, scheme=Scheme.UPWIND)
    bar = AdjointState.equilibrium(np.zeros((3, 5)))
    bar.add_by_mean(engine, -2.0 * physics.storage)
    bar.add_by_mobile(engine, 0.5 * engine.storage)
    assert (bar.lowest, bar.highest) == (pytest.approx(-2.0), pytest.approx(0.5))
    assert bar.bounds == pytest.approx((-2.0 - 2.5 * OVERSHOOT, 0.5 + 2.5 * OVERSHOOT))


def test_what_is_not_finite_is_refused() -> None:
    refuse_not_finite(1.0, np.ones(2))
    with pytest.raises(InputError, match='gradient: not finite; ask for a shorter horizon'):
        refuse_not_finite(1.0, np.ones(2), np.array([np.nan]))
    with pytest.raises(InputError, match='cost inf: not finite'):
        refuse_not_finite(np.inf)
