"""Transport through PyTorch beside the compiled kernels."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from effect_examples import described

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Boundaries
from porotwin_solver.coefficients.physics import Physics, nominal_physics
from porotwin_solver.effects import changed_physics
from porotwin_solver.model.engine import PROCESSOR, Engine, State
from porotwin_solver.transport.scheme import Scheme
from porotwin_solver.transport.torch_transport import TorchTransport

DEVICES = [
    'cpu:0',
    pytest.param(
        'cuda',
        marks=pytest.mark.skipif(
            not torch.cuda.is_available(), reason='this machine has no graphics processor'
        ),
    ),
]


def advanced(physics: Physics, scheme: Scheme, rates: WellRates, device: str) -> State:
    """Return the state after some steps on `device`."""
    engine = Engine(physics, scheme=scheme, device=device)
    start = np.zeros(physics.grid.shape)
    start[3:12, 2:9] = np.random.default_rng(4).random((9, 7))
    state = State.equilibrium(start)
    for coefficients in engine.interval(state, rates, 150.0):
        assert len(coefficients.levels.count_at_least) > 3  # local time steps are at work
        engine.step(state, coefficients)
    return state


@pytest.mark.parametrize('device', DEVICES)
@pytest.mark.parametrize('scheme', list(Scheme))
@pytest.mark.parametrize('effect', ['', 'dispersion', 'dual_porosity'])
def test_a_device_gives_the_map_of_the_kernels(rig, rates, scheme, effect, device) -> None:
    opened = rig.model_copy(update={'boundaries': Boundaries(top='open', left='open')})
    effects = [described(effect)] if effect else []
    plain = nominal_physics(opened, rig.grid(31, 19))
    physics = changed_physics(plain, effects)
    rates = {name: replace(well, rate=2 * well.rate) for name, well in rates.items()}
    kernels = advanced(physics, scheme, rates, PROCESSOR)
    on_device = advanced(physics, scheme, rates, device)
    np.testing.assert_allclose(on_device.mobile, kernels.mobile, atol=1e-12)
    np.testing.assert_allclose(on_device.immobile, kernels.immobile, atol=1e-12)
    np.testing.assert_allclose(on_device.tracer_lost, kernels.tracer_lost, rtol=1e-12)
    assert kernels.tracer_lost[1] > 0.0


def test_an_absent_device_is_one_clear_line() -> None:
    with pytest.raises(InputError, match="device 'cuda:99': PyTorch, which finds"):
        TorchTransport('cuda:99', Scheme.SUPERBEE)
    with pytest.raises(InputError, match="device 'toaster'"):
        TorchTransport('toaster', Scheme.SUPERBEE)
