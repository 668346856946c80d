"""Random numbers and places of the blind check."""

import numpy as np
import pytest

from porotwin_core.model.blind_draw import (
    DrawContext,
    displacement,
    factor_off_one,
    log_uniform,
    place_near_injector,
)
from porotwin_core.rig import Boundaries, Rig, Well

RIG = Rig(
    name='small',
    width_m=0.934,
    height_m=0.562,
    depth_m=0.010,
    porosity=0.375,
    permeability_m2=6.57e-10,
    viscosity_pa_s=1.0e-3,
    density_kg_m3=998.0,
    boundaries=Boundaries(),
    wells={'injector': Well(x_m=0.235, z_m=0.235)},
)
CONTEXT = DrawContext(RIG, ('injector',), 3600.0, 450.0)


def test_a_density_difference_sinks_tracer_by_one_metre_within_the_recording() -> None:
    speed = CONTEXT.sinking * 6.57e-10 * 9.81 / (1e-3 * 0.375)
    assert speed * 3600.0 == pytest.approx(1.0)


def test_draws_keep_their_ranges() -> None:
    generator = np.random.default_rng(3)
    for _ in range(200):
        assert 2.0 <= log_uniform(generator, 2.0, 8.0) <= 8.0
        assert 0.1 <= abs(factor_off_one(generator, 0.1, 0.3) - 1.0) <= 0.3
        x, z = place_near_injector(generator, CONTEXT)
        assert 0.05 <= x <= 0.884
        assert 0.05 <= z <= 0.512
        assert np.hypot(x - 0.235, z - 0.235) <= 0.16
        assert all(1.5e-3 <= abs(d) <= 6e-3 for d in displacement(generator, CONTEXT).values())
