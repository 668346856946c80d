"""Fixtures of the hub: the toy rig, its controller and its model, and a unit square."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hub_examples import SMALL_RIG, TOY, ToyModel

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rig import Rig, load_rig, parse_rig
from porotwin_hub.control.controller import Controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.objectives.objective_registry import make_objective


@pytest.fixture(scope='session')
def toy_rig() -> Rig:
    """A rig with one control well, `push`."""
    return parse_rig(TOY, Path('rig.yaml'))


@pytest.fixture(scope='session')
def toy_grid(toy_rig: Rig) -> Grid:
    """A coarse grid over the toy rig."""
    return toy_rig.grid(20, 10)


@pytest.fixture(scope='session')
def toy_limits(toy_rig: Rig) -> Limits:
    """The limits of the toy rig."""
    return Limits.of(toy_rig)


@pytest.fixture(scope='session')
def toy_controller(toy_rig: Rig, toy_grid: Grid, toy_limits: Limits) -> Controller:
    """A controller of the toy rig with its own objective."""
    objective = make_objective(toy_rig, toy_grid)
    return Controller(toy_limits, objective, horizon=600.0, evaluations=40)


@pytest.fixture
def toy_model() -> ToyModel:
    """The physics-based model of the toy rig."""
    return ToyModel()


@pytest.fixture(scope='session')
def small_rig() -> Rig:
    """The paper's small rig."""
    return load_rig(SMALL_RIG)


@pytest.fixture(scope='session')
def unit_rig() -> dict[str, Any]:
    """The keys of a rig of 1 m x 1 m, without control."""
    return {
        'name': 'unit',
        'width_m': 1.0,
        'height_m': 1.0,
        'depth_m': 0.01,
        'porosity': 0.4,
        'permeability_m2': 1e-9,
        'viscosity_pa_s': 1e-3,
        'density_kg_m3': 998.0,
        'wells': {'a': {'x_m': 0.5, 'z_m': 0.5}},
    }


@pytest.fixture(scope='session')
def square() -> FloatArray:
    """A square zone in the unit rig, (corners, 2) [m]."""
    return np.array([[0.2, 0.2], [0.6, 0.2], [0.6, 0.6], [0.2, 0.6]])
