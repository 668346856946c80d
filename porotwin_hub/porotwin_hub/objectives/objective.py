"""The objective of the controller: the cost of a tracer distribution, to be minimised.

A plan over time costs the integral of `terms`, plus water (`water_cost`). All terms are linear or
quadratic in the concentration, so that the adjoint of the model gives the derivatives of any plan.

An objective is one file in `porotwin_hub/objectives`, chosen in `rig.yaml` by its name. The file
defines `OBJECTIVE`, an `ObjectiveKind`; `objective_registry` finds it (docs/extend/objective.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rig import Rig
from porotwin_solver.effects import tracer_storage

FUZZY_SHARE = 0.02
"""Share of the fuzzy mask in the cost of a plan; the rest is the zone itself. A plan sees the plume
reach the zone, so that tracer beside it need not cost much. It costs a little, because a front that
stands at the edge is a risk. On the small rig the fuzzy mask alone doubles the dose."""


AT_ONCE_S = 600.0
"""A misfit at one moment costs as much as if it lasted so long [s], a few photo intervals."""


class Objective(Protocol):
    """The cost of a tracer distribution on one grid."""

    @property
    def goal(self) -> str:
        """A few words for people: the reason of a setpoint."""
        ...

    @property
    def water_cost(self) -> float:
        """Cost of the water that the control wells inject [s]: m^3 s of the objective per m^3."""
        ...

    def __call__(self, concentration: FloatArray) -> float:
        """Return the cost f [m^3] of a map (nz, nx) [-]; unseen cells (NaN) count as empty.

        COBYLA minimises it. It should change smoothly while the plume moves.
        """
        ...

    def terms(self, now: float, horizon: float) -> Sequence[CostTerm]:
        """Return the terms of a plan's cost [m^3 s] over `horizon` [s] from a state on.

        `now` is the time of the state since the start of the experiment [s].
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
    """Return the pore volume of every cell (nz, nx) [m^3], with the effects of the rig."""
    return tracer_storage(rig, grid)


@dataclass(frozen=True)
class WeightedTracer:
    """An objective that weights the tracer of every cell: f(c) = sum(c * weights) [m^3].

    This is the paper's integral of c varphi (section 4), weighted by the pore volume, so that the
    cost is a volume of tracer stock also where porosity or depth vary. A plan costs the dose: the
    tracer in the disallowed cells over time, with a small share of f.

    `weights` are varphi times pore volume; `disallowed` are the pore volumes of the disallowed
    cells and 0 elsewhere; both (nz, nx) [m^3].
    """

    goal: str
    weights: FloatArray
    disallowed: FloatArray
    water_cost: float = 0.0

    def __call__(self, concentration: FloatArray) -> float:
        """Return f of a map (nz, nx) [m^3]; unseen cells (NaN) count as empty."""
        return float(np.nansum(concentration * self.weights))

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return the tracer in the disallowed cells of a map (nz, nx) [m^3]."""
        return float(np.nansum(concentration * self.disallowed))

    def terms(self, now: float, horizon: float) -> Sequence[CostTerm]:  # noqa: ARG002  any time
        """Return the dose, with a share of the fuzzy cost, over `horizon` [s]."""
        weights = FUZZY_SHARE * self.weights + (1.0 - FUZZY_SHARE) * self.disallowed
        return (CostTerm(0.0, horizon, linear=weights),)


@dataclass(frozen=True)
class TargetTracer:
    """An objective that wants a certain map: f(c) = sum(weights * (c - target)^2) [m^3].

    `weights` (nz, nx) [m^3] and `target` (nz, nx) [-] lie on the same grid. A plan costs the
    integral of f over time, or f at the time `at` [s] after the start of the experiment, as much
    as if it lasted for AT_ONCE_S.
    """

    goal: str
    weights: FloatArray
    target: FloatArray
    at: float | None = None
    water_cost: float = 0.0

    def __call__(self, concentration: FloatArray) -> float:
        """Return f of a map (nz, nx) [m^3]; unseen cells (NaN) count as empty."""
        seen = np.nan_to_num(concentration)
        return float((self.weights * (seen - self.target) ** 2).sum())

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return how much tracer is missing or too much, weighted, of a map (nz, nx) [m^3]."""
        seen = np.nan_to_num(concentration)
        return float((self.weights * abs(seen - self.target)).sum())

    def terms(self, now: float, horizon: float) -> Sequence[CostTerm]:
        """Return f over `horizon` [s], or at its time; nothing once that is over."""
        if self.at is None:
            return (CostTerm(0.0, horizon, quadratic=self.weights, target=self.target),)
        if self.at < now:
            return ()
        moment = min(self.at - now, horizon)
        return (CostTerm(moment, moment, quadratic=AT_ONCE_S * self.weights, target=self.target),)


@dataclass(frozen=True)
class LeastWater:
    """An objective that costs water only: `water_cost` [s] as in `Objective`."""

    goal: str
    water_cost: float

    def __call__(self, concentration: FloatArray) -> float:  # noqa: ARG002
        """Return 0: no map costs anything."""
        return 0.0

    def disallowed_tracer(self, concentration: FloatArray) -> float:  # noqa: ARG002
        """Return 0: tracer may be anywhere."""
        return 0.0

    def terms(self, now: float, horizon: float) -> Sequence[CostTerm]:  # noqa: ARG002
        """Return nothing."""
        return ()


@dataclass(frozen=True)
class WeightedSum:
    """Several objectives at once, each with its weight [-]."""

    parts: tuple[tuple[float, Objective], ...]

    @property
    def goal(self) -> str:
        """The goals of all parts, each once."""
        return ', '.join(dict.fromkeys(part.goal for _, part in self.parts))

    @property
    def water_cost(self) -> float:
        """The sum over all parts [s]."""
        return sum(weight * part.water_cost for weight, part in self.parts)

    def __call__(self, concentration: FloatArray) -> float:
        """Return the weighted sum of the costs of a map (nz, nx) [m^3]."""
        return sum(weight * part(concentration) for weight, part in self.parts)

    def disallowed_tracer(self, concentration: FloatArray) -> float:
        """Return the tracer where it must not be, of a map (nz, nx) [m^3], without weights.

        Tracer that a target still lacks does not count beside a zone to keep free.
        """
        parts = [part for _, part in self.parts]
        zones = [part for part in parts if isinstance(part, WeightedTracer)]
        return sum(part.disallowed_tracer(concentration) for part in zones or parts)

    def terms(self, now: float, horizon: float) -> Sequence[CostTerm]:
        """Return the weighted terms of all parts."""
        return [
            term.weighted(weight)
            for weight, part in self.parts
            for term in part.terms(now, horizon)
        ]
