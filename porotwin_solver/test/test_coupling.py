"""The flow that the tracer drives."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.errors import InputError
from porotwin_core.wells import WellRate
from porotwin_solver.coupling import Coupling
from porotwin_solver.physics import nominal_physics


def test_viscosities_too_far_apart_are_refused(rig) -> None:
    physics = nominal_physics(rig, rig.grid(30, 20))
    coupled = Coupling(replace(physics, viscosity_ratio=50.0), max_iterations=5)
    concentration = np.random.default_rng(5).uniform(0.0, 1.0, (20, 30))
    with pytest.raises(InputError, match='viscosity_ratio 50: the pressure does not converge in 5'):
        coupled.flux({next(iter(rig.wells)): WellRate(1e-7)}, concentration)
