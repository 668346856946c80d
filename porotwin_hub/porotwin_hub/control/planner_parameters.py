"""The parameters of the hub that tell how setpoints are chosen, and the planner that follows."""

import math
import queue
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from rclpy.node import Node

from porotwin_core.basis.units import DAY_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rate_periods import OPEN_HORIZON_S
from porotwin_core.rig import Rig
from porotwin_core.ros.node import declare
from porotwin_hub.control.controller import Controller, Planner, WithSubstitute
from porotwin_hub.control.plan_controller import plan_controller
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.models.clients import Caller, PlanModelClient
from porotwin_hub.objectives.objective_registry import make_objective

OPTIMISER_SHARE = 0.5
"""Share of the photo interval that one optimisation may take: the rest is for the forecast."""


@dataclass(frozen=True)
class ControlSettings:
    """The parameters of the controller: `optimiser`, `horizon` [s], `evaluations` of COBYLA."""

    enabled: bool
    optimiser: str
    horizon: float
    evaluations: int


class PlannerParameters:
    """Declares the parameters at a node, and makes the planner from their present values."""

    def __init__(
        self, node: Node, rig: Rig, grid: Grid, call: Caller, *, interval: float, simulated: bool
    ) -> None:
        """Declare the parameters.

        Args:
            node: declares them.
            rig: without a control section no planner is ever made.
            grid: of the maps.
            call: calls the services of the models.
            interval: time between photographs [s].
            simulated: whether time waits for the twin, so that a decision may take any time.

        Raises:
            InputError: a parameter or the objective of the rig is wrong.
        """
        self._changes: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._declare(node)
        judge = declare(
            node,
            'plans_judged_by',
            'solver',
            'source of the cost of a plan: the solver, or the mean of some siblings with all their '
            'doubt, at several times the work',
            choices=('solver', 'siblings'),
        )
        self._controls = rig.control is not None
        if not self._controls:
            return
        patience = math.inf if simulated else OPTIMISER_SHARE * interval
        self._make_constant = partial(
            Controller,
            Limits.of(rig),
            make_objective(rig, grid),
            patience=patience,
            pauses=FixedPauses.of(rig),
        )
        self._make_plan = partial(
            plan_controller,
            rig,
            grid,
            PlanModelClient(call, rig, judge),
            interval=interval,
            patience=patience,
        )

    def planner(self) -> Planner | None:
        """Return the planner of the present parameters; None: choose no setpoints."""
        settings = self._settings
        if not self._controls or not settings.enabled:
            return None
        constant = self._make_constant(horizon=settings.horizon, evaluations=settings.evaluations)
        if settings.optimiser == 'cobyla':
            return constant
        return WithSubstitute(self._make_plan(horizon=settings.horizon), constant)

    def take_changes(self) -> list[str]:
        """Return the changes since the last call in words; the planner has changed with them."""
        return [self._changes.get() for _ in range(self._changes.qsize())]

    def _declare(self, node: Node) -> None:
        """Declare the parameters.

        All but `control` may change at any time: with plain DDS any node may set a parameter, and
        none but a restart may switch control off.
        """
        enabled = declare(
            node,
            'control',
            True,
            'choose setpoints when rig.yaml allows it',
        )
        horizon = declare(
            node,
            'horizon_s',
            OPEN_HORIZON_S,
            'how far the optimiser looks ahead, where rig.yaml names no end of the experiment [s]',
            at_least=1.0,
            at_most=DAY_S,
            on_change=self._change('horizon'),
        )
        evaluations = declare(
            node,
            'evaluations',
            60,
            'predictions per search of COBYLA',
            at_least=1,
            at_most=10_000,
            on_change=self._change('evaluations'),
        )
        optimiser = declare(
            node,
            'optimiser',
            'gradient',
            'how setpoints are chosen: gradient plans to the end of the experiment, cobyla (the '
            "paper's) searches constant rates over the horizon",
            choices=('gradient', 'cobyla'),
            on_change=self._change('optimiser'),
        )
        self._settings = ControlSettings(enabled, optimiser, horizon, evaluations)

    def _change(self, name: str) -> Callable[[Any], None]:
        """Return the function that takes a new value of the setting `name`."""

        def change(value: Any) -> None:
            self._settings = replace(self._settings, **{name: value})
            self._changes.put(f'the {name} of the optimiser was set to {value} while the hub runs')

        return change
