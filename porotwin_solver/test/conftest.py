"""Rigs and rates that the tests of the solver share."""

from collections.abc import Callable
from typing import Any

import pytest

from lab.benches.bench_solver import bench_rig
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig

MakeRig = Callable[..., Rig]


def make_rig(**changes: Any) -> Rig:
    """Return the paper's small rig with some of its fields changed."""
    return Rig(**{**bench_rig().model_dump(), **changes})


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
