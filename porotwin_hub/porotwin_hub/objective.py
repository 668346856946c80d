"""The objective of the controller: the cost of a tracer distribution, to be minimised.

An objective is one file in `porotwin_hub/objectives`, chosen in `rig.yaml` by its name. The file
defines `OBJECTIVE`, an `ObjectiveKind`; `objective_registry` finds it (docs/extend/objective.md).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig


class Objective(Protocol):
    """The cost of a tracer distribution on one grid."""

    @property
    def goal(self) -> str:
        """A few words for people: the reason of a setpoint."""
        ...

    def __call__(self, concentration: FloatArray) -> float:
        """Return the cost f [m^3] of a map (nz, nx) [-]; unseen cells (NaN) count as empty.

        The optimiser minimises it. It should change smoothly while the plume moves.
        """
        ...

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return the volume of tracer stock [m^3] where it must not be, for reports and pictures.

        `concentration` is a map (nz, nx) [-]; unseen cells (NaN) count as empty.
        """
        ...


class ObjectiveParameters(BaseModel):
    """The parameters of an objective as in `rig.yaml`; unknown ones are refused."""

    model_config = ConfigDict(extra='forbid', frozen=True)


@dataclass(frozen=True)
class ObjectiveKind:
    """An objective that `rig.yaml` may name.

    `make(rig, grid, parameters)` returns the objective on a grid; `parameters` is an instance of
    the model of the same name. `summary` is one line for people.
    """

    name: str
    summary: str
    parameters: type[ObjectiveParameters]
    make: Callable[[Rig, Grid, Any], Objective]


def pore_volume(rig: Rig, grid: Grid) -> FloatArray:
    """Return porosity * depth * cell area, the pore volume of every cell (nz, nx) [m^3]."""
    return rig.cell_pore_volume(grid)


@dataclass(frozen=True)
class WeightedTracer:
    """An objective that weights the tracer of every cell: f(c) = sum(c * weights) [m^3].

    This is the paper's integral of c varphi (section 4), weighted by the pore volume, so that the
    cost is a volume of tracer stock also where porosity or depth vary.

    `weights` are varphi times pore volume; `disallowed` are the pore volumes of the disallowed
    cells and 0 elsewhere; both (nz, nx) [m^3].
    """

    goal: str
    weights: FloatArray
    disallowed: FloatArray

    def __call__(self, concentration: FloatArray) -> float:
        """Return f of a map (nz, nx) [m^3]; unseen cells (NaN) count as empty."""
        return float(np.nansum(concentration * self.weights))

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return the tracer in the disallowed cells of a map (nz, nx) [m^3]."""
        return float(np.nansum(concentration * self.disallowed))
