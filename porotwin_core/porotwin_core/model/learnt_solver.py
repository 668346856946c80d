"""The interface of a solver for the data-driven model: a model for every learnt physics.

The data-driven model never imports a solver. The command passes a class, and the node loads the
class in its parameter `solver`, as Navigation2 loads its planners.
"""

import importlib
from collections.abc import Callable
from typing import Protocol, cast

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig


class StepModel(Protocol):
    """A physics-based model, one interval at a time; maps are (nz, nx), sigma is [1/s]."""

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the map `time_step` [s] after `concentration`."""

    def residual(
        self, previous: FloatArray, next_: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return r = L c - f_c [1/s] of an observed pair of maps."""

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the solution of L c = f_c + sigma."""

    def source_of(self, change: FloatArray, time_step: float) -> FloatArray:
        """Return the sigma that adds `change` to a prediction in one `time_step` [s]."""

    def step_adjoint(
        self, previous: FloatArray, rates: WellRates, time_step: float, bar: FloatArray
    ) -> FloatArray:
        """Return dJ/dprevious of a cost J with `bar` = dJ/d(prediction)."""


class LearntSolver(Protocol):
    """Models of one rig, grid and scheme with any learnt physics."""

    def model(self, learnt: LearntPhysics) -> StepModel:
        """Return the model with this physics; without any, the model that COSTA corrects."""


LearntSolverMaker = Callable[[Rig, Grid, str], LearntSolver]
"""(rig, grid, preset) -> solver."""


def solver_named(name: str) -> LearntSolverMaker:
    """Return the maker of solvers called `name`, such as `package.module:Class`.

    Raises:
        InputError: there is none.
    """
    module, _, member = name.partition(':')
    try:
        return cast('LearntSolverMaker', getattr(importlib.import_module(module), member))
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"solver '{name}': cannot be loaded ({error}); write package.module:Class"
        ) from None
