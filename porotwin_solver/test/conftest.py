"""Rigs and rates that the tests of the solver share."""

from collections.abc import Callable
from typing import Any

import pytest

from porotwin_core.rig import Boundaries, Rig, Well
from porotwin_core.units import from_ml_h
from porotwin_core.wells import WellRate

MakeRig = Callable[..., Rig]


def make_rig(**changes: Any) -> Rig:
    """Return the paper's small rig with some of its fields changed."""
    fields: dict[str, Any] = {
        'name': 'small',
        'width_m': 0.934,
        'height_m': 0.562,
        'depth_m': 0.010,
        'porosity': 0.375,
        'permeability_m2': 6.57e-10,
        'viscosity_pa_s': 1.0e-3,
        'density_kg_m3': 998.0,
        'boundaries': Boundaries(),
        'wells': {
            'injector': Well(x_m=0.235, z_m=0.235),
            'producer': Well(x_m=0.660, z_m=0.160),
            'control1': Well(x_m=0.120, z_m=0.420),
            'control2': Well(x_m=0.500, z_m=0.375),
            'control3': Well(x_m=0.760, z_m=0.460),
        },
    }
    return Rig(**{**fields, **changes})


@pytest.fixture(name='make_rig')
def _make_rig() -> MakeRig:
    return make_rig


@pytest.fixture
def rig() -> Rig:
    """The paper's small rig: open top, closed sides, five wells."""
    return make_rig()


@pytest.fixture
def rates() -> dict[str, WellRate]:
    """Rates of three wells: one injects tracer, one water, the third produces the sum of both."""
    return {
        'injector': WellRate(from_ml_h(500.0), 1.0),
        'control2': WellRate(from_ml_h(150.0), 0.0),
        'producer': WellRate(from_ml_h(-650.0)),
    }
