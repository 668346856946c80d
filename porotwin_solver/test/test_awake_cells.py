"""Cells that sleep: the same maps and balance as if all cells were awake."""

import math

import numpy as np
import pytest

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRate
from porotwin_solver.coefficients.physics import nominal_physics
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.transport import transport
from porotwin_solver.transport.awake_cells import ASLEEP, AT_ONCE
from porotwin_solver.transport.scheme import Scheme


def all_awake(c, flux, sources, ends, first_change, extent, first, last) -> None:
    """Do as the kernel `wake`, but let no cell sleep."""
    nx = c.shape[1]
    first_change[first * nx : last * nx] = AT_ONCE
    extent[first:last] = 0, nx


def advanced(rig, rates, scheme: Scheme, begin: FloatArray, steps: int) -> tuple[Engine, State]:
    """Return a state `steps` minutes after the concentration `begin`."""
    engine = Engine(nominal_physics(rig, rig.grid(93, 56)), scheme=scheme)
    state = State.equilibrium(begin)
    for _ in range(steps):
        engine.advance(state, rates, 60.0)
    return engine, state


@pytest.mark.parametrize('scheme', list(Scheme))
def test_sleep_changes_no_map(rig, rates, scheme, monkeypatch: pytest.MonkeyPatch) -> None:
    empty = np.zeros((56, 93))
    _, asleep = advanced(rig, rates, scheme, empty, 30)
    monkeypatch.setattr(transport, 'wake', all_awake)
    _, awake = advanced(rig, rates, scheme, empty, 30)
    np.testing.assert_allclose(asleep.mobile, awake.mobile, atol=1e-10)
    np.testing.assert_allclose(asleep.tracer_lost, awake.tracer_lost, rtol=1e-12, atol=1e-25)


def test_the_balance_holds_while_most_cells_sleep(rig, rates) -> None:
    engine, state = advanced(rig, rates, Scheme.SUPERBEE, np.zeros((56, 93)), 80)
    injected = 80 * 60.0 * rates['injector'].rate * rates['injector'].concentration
    kept = math.fsum((engine.storage * state.mobile).ravel())
    assert kept + state.tracer_lost.sum() == pytest.approx(injected, rel=1e-12)
    assert state.mobile.min() >= 0.0
    assert state.mobile.max() <= 1.0 + 1e-14


def test_a_full_rig_sleeps_but_where_other_water_enters_and_tracer_leaves(rig) -> None:
    engine = Engine(nominal_physics(rig, rig.grid(93, 56)), scheme=Scheme.SUPERBEE)
    rates = {'injector': WellRate(1e-7, 1.0), 'producer': WellRate(-1e-7)}
    state = State.equilibrium(np.ones((56, 93)))
    coefficients = engine.coefficients(state, rates, 60.0)
    awake = transport.awake_cells(
        state.mobile,
        coefficients.flux,
        coefficients.sources,
        engine.storage,
        coefficients.levels,
        transport.FluxAccumulators.zeros(engine.grid),
    )
    found = (awake.first_change < ASLEEP).reshape(56, 93)
    assert found[coefficients.sources.outflow > 0.0].all()
    assert not found[coefficients.sources.inflow > 0.0].any()
    assert found[1:-1, 1:-1].mean() < 0.1
