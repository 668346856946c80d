"""The siblings as a node: they listen to the twin, and publish forecasts with bands.

Callbacks only convert and store. A worker takes the newest photograph, learns from it, and tells
the forecast. A proposed schedule is answered beside it. Nothing here is ever pumped.
"""

import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import MOST_WORKERS, YIELDING, LastingCrew, ThreadCrew, crew
from porotwin_core.basis.units import MINUTE_S
from porotwin_core.clock.freshness import stamp_doubts
from porotwin_core.clock.photo_interval import LONGEST_GAP_INTERVALS
from porotwin_core.clock.stamps import SAME_PHOTOGRAPH_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import OPEN_HORIZON_S
from porotwin_core.rates.wells import RateStep
from porotwin_core.rig import EffectDescription
from porotwin_core.rig.coarse_grid import COARSE_CELLS, coarse_grid
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.model_effects import ToldEffects
from porotwin_core.ros.node import (
    Diagnostics,
    TwinNode,
    declare,
    declare_grid,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.run_topics import follow_run
from porotwin_core.ros.single_instance import only_one
from porotwin_msgs.msg import CleanState, CycleReport, Forecast, NewState
from porotwin_msgs.srv import CostGradient, WhatIf
from porotwin_siblings.continuity import periods_until
from porotwin_siblings.diagnosed_effects import read_diagnosis
from porotwin_siblings.expected_cost import chosen_judges, expected_cost
from porotwin_siblings.outlook import TIMES, Outlook, answers
from porotwin_siblings.photograph import Photograph
from porotwin_siblings.proposed_rates import (
    LONGEST_HORIZON_S,
    check_balance,
    check_proposal,
    check_steps,
    concentration_note,
    proposed_plan,
)
from porotwin_siblings.siblings import NO_PUMPS, Siblings
from porotwin_siblings.siblings_messages import (
    forecast_to_msg,
    photograph_from_msg,
)
from porotwin_solver.adjoint.schedule_cost import ScheduleCost
from porotwin_solver.model.water_balance import water_balance

MAPS = 2
"""Maps of a forecast: half way, and at its end."""

SETPOINT_WAIT_S = 3.0
"""Wait for the setpoint that follows a photograph [s]; the hub takes a second or two."""


class _Arrived(NamedTuple):
    """A photograph, and the number of its state."""

    sequence: int
    photograph: Photograph


class SiblingsNode(TwinNode):
    """An ensemble of twins: learns from photographs, forecasts (`siblings/forecast`, `what_if`)."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters and start the worker.

        Raises:
            InputError: a parameter or the rig is wrong.
        """
        super().__init__('siblings', **kwargs)
        self._rig = declare_rig(self)
        self._map_grid = declare_grid(self, self._rig)
        self._producer = self._rig.control.producer if self._rig.control else None
        workers = declare(
            self, 'workers', 2, 'threads that learn', at_least=1, at_most=MOST_WORKERS
        )
        self._horizon = declare(
            self,
            'horizon_s',
            OPEN_HORIZON_S,
            'how far forecasts look ahead [s]',
            at_least=60.0,
            at_most=LONGEST_HORIZON_S,
        )
        interval = declare_photo_interval(
            self, also=f'; after {LONGEST_GAP_INTERVALS} without one, forecasts begin anew'
        )
        self._longest_gap = LONGEST_GAP_INTERVALS * interval
        self._simulated = self.simulated
        self._doubt = stamp_doubts(interval, simulated=self._simulated)
        self._judges = declare(
            self,
            'judges',
            4,
            'siblings whose mean cost siblings/cost_gradient answers; each takes as long as a '
            'gradient of the solver',
            at_least=1,
            at_most=1000,
        )
        self._worst_share = declare(
            self,
            'worst_share',
            1.0,
            'share of the judges, those with the highest costs, whose mean counts: 1 is the '
            'expected cost, 0.5 the mean of the worse half, for a cautious plan',
            at_least=0.01,
            at_most=1.0,
        )
        diagnosis = declare(
            self, 'diagnosis', '', 'diagnosis.json whose effects the siblings draw; empty: none'
        )
        self._quick = ThreadCrew(workers)
        self._patient = _learning_executor(
            self._declare_scheduler(), workers, self.get_logger().warning
        )
        self._make_siblings = partial(
            Siblings,
            grid=self._declare_grid(),
            map_grid=self._map_grid,
            executor=self._patient,
            count=declare(
                self,
                'siblings',
                32,
                'number of siblings: more than the wells, the other unknown numbers of effects and '
                'the numbers of a diagnosis together',
                at_least=2,
                at_most=1000,
            ),
            diagnosed=read_diagnosis(Path(diagnosis)) if diagnosis else (),
        )
        self.siblings = self._make_siblings(self._rig)
        self._effects: tuple[EffectDescription, ...] = ()
        self._new_effects: tuple[EffectDescription, ...] | None = None
        self._rates = RateHistory.of(self._rig)
        self._changed = threading.Condition()
        self._pumps: tuple[float, Mapping[str, PumpFactor]] = (-math.inf, NO_PUMPS)
        """Stamp [s] and content of the hub's belief in the pumps."""
        self._arrived: _Arrived | None = None
        self._interrupted = False
        self._forecast: Outlook | None = None
        self._diagnostics = Diagnostics(self)
        self._make_topics()
        threading.Thread(target=self._work, daemon=True).start()

    def destroy_node(self) -> None:
        """End the node; courses that have not begun are given up, so that its process can end."""
        for executor in (self._quick, self._patient):
            executor.shutdown(wait=False, cancel_futures=True)
        super().destroy_node()

    def _declare_grid(self) -> Grid:
        """Return the grid of the siblings, which is never finer than the maps."""
        cells = declare(
            self,
            'cells',
            COARSE_CELLS,
            'cells of the grid of the siblings; four times as many take eight times as long',
            at_least=100,
            at_most=1_000_000,
        )
        return coarse_grid(self._rig, self._map_grid, cells)

    def _declare_scheduler(self) -> str:
        return str(
            declare(
                self,
                'scheduler',
                '',
                'address of a Dask scheduler that runs the siblings; empty: threads here',
            )
        )

    def _make_topics(self) -> None:
        self._publisher = self.create_publisher(Forecast, 'siblings/forecast', qos.CONFIG)
        follow_run(
            self,
            rates=self._rates,
            lock=self._changed,
            on_state=self._on_state,
            on_clean_state=self._on_clean_state,
            on_effects=self._on_effects,
        )
        follow(self, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        # a question must not wait for messages, nor messages for its answer
        own = MutuallyExclusiveCallbackGroup()
        self.create_service(WhatIf, 'siblings/what_if', self._what_if, callback_group=own)
        other = MutuallyExclusiveCallbackGroup()
        self.create_service(
            CostGradient, 'siblings/cost_gradient', self._cost_gradient, callback_group=other
        )

    # --- messages in --------------------------------------------------------------------------

    def _on_cycle(self, message: CycleReport) -> None:
        if pumps := conversions.pumps_from_msg(message.rate_factors):
            with self._changed:
                self._pumps = conversions.time_from_msg(message.header.stamp), pumps

    def _on_clean_state(self, message: CleanState) -> None:
        with self._changed:
            self._interrupted = True

    def _on_effects(self, told: ToldEffects) -> None:
        with self._changed:
            self._new_effects = told.effects

    def _on_state(self, message: NewState) -> None:
        try:
            photograph = photograph_from_msg(message, self._map_grid)
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')
            return
        if doubt := self._doubt(photograph.time):
            self.get_logger().warning(f'state {message.sequence} ignored: {doubt}')
            return
        with self._changed:
            self._arrived = _Arrived(message.sequence, photograph)
            self._changed.notify_all()

    # --- work ---------------------------------------------------------------------------------

    def _work(self) -> None:
        while self.context.ok():
            with self._changed:
                self._changed.wait_for(lambda: self._arrived is not None)
                arrived, self._arrived = self._arrived, None
                assert arrived is not None
            try:
                with self._diagnostics.busy(f'state {arrived.sequence}'):
                    self._learn(arrived.photograph)
                    self._tell()
            except Exception as error:  # the siblings outlive any one photograph
                if not self.context.ok():
                    return
                self.get_logger().error(f'state {arrived.sequence} failed: {error!r}')
                self._diagnostics.report(DiagnosticStatus.ERROR, f'siblings failed: {error!r}')
                with self._changed:  # the rates until this photograph are used up
                    self._interrupted = True
                continue
            self._diagnostics.report(DiagnosticStatus.OK, f'state {arrived.sequence} done')

    def _learn(self, photograph: Photograph) -> None:
        siblings = self.siblings
        if self._follow_effects(photograph):
            return
        with self._changed:
            interrupted = self._interrupted or self._is_late(photograph)
            self._interrupted = False
            periods = periods_until(photograph.time, siblings, self._rates, interrupted=interrupted)
            told_at, pumps = self._pumps
        # a belief by another clock, before time went back, is none
        siblings.observe(photograph, periods, pumps if told_at <= photograph.time else NO_PUMPS)

    def _is_late(self, photograph: Photograph) -> bool:
        """Return whether the last photograph is too old to compute from it to `photograph`."""
        gap = photograph.time - self.siblings.time if self.siblings.started else 0.0
        if gap > self._longest_gap:
            self.get_logger().warning(
                f'interrupted: {gap:.0f} s without a photograph; the forecasts begin anew'
            )
        return gap > self._longest_gap

    def _follow_effects(self, photograph: Photograph) -> bool:
        """Return whether other effects act: new siblings, who have learnt nothing, then follow.

        What the others had learnt may stand for the same effects under other names.
        """
        with self._changed:
            effects = self._new_effects  # they stay until siblings have them
            if effects is None or effects == self._effects:
                return False
            self._interrupted = False
            self._pumps = (-math.inf, NO_PUMPS)  # the hub learns them anew too
            # the rates go on as they do for siblings who stay
            periods_until(photograph.time, self.siblings, self._rates, interrupted=False)
        siblings = self._make_siblings(self._rig.with_effects(effects))
        siblings.observe(photograph)
        self.siblings, self._effects = siblings, effects
        self.get_logger().info(f'{len(effects)} effects beyond rig.yaml; learning anew')
        return True

    def _tell(self) -> None:
        """Publish the forecast under the rates of the setpoint that follows from the photograph."""
        time = self.siblings.time
        with self._changed:
            self._changed.wait_for(
                lambda: self._arrived is not None or self._rates.is_commanded(time),
                timeout=SETPOINT_WAIT_S if self.count_publishers('wells/setpoint') else 0.0,
            )
            present = self._rates.plan(time, self._ahead())
        self._forecast = self._outlook(present, self._ahead())
        self._publisher.publish(self._as_message(self._forecast))

    def _ahead(self) -> float:
        """Return how far to look ahead [s].

        It is to the end of the experiment where it is known, for `LONGEST_HORIZON_S` at most.
        """
        control = self._rig.control
        if control is None or control.end_min is None or self._rates.began is None:
            return self._horizon
        left = self._rates.began + MINUTE_S * control.end_min - self.siblings.time
        return min(left, LONGEST_HORIZON_S) if left > SAME_PHOTOGRAPH_S else self._horizon

    def _outlook(self, plan: Sequence[RateStep], horizon: float, *, quick: bool = False) -> Outlook:
        """Return the expectations under `plan` over `horizon` [s].

        A `quick` answer comes from prompt threads, and from fewer siblings, who stand for equal
        shares of all.

        Raises:
            InputError: the plan is wrong.
        """
        times = np.linspace(0.0, horizon, TIMES + 1)[1:]
        maps = np.linspace(0.0, horizon, MAPS + 1)[1:]
        if not quick:
            return self.siblings.outlook(plan, horizon, times, maps)
        last = self._forecast
        ranked = last.ranked if last is not None else ()
        numbers = chosen_judges(ranked, answers(len(ranked), horizon))
        return self.siblings.outlook(
            plan, horizon, times, maps, executor=self._quick, numbers=numbers
        )

    # --- messages out -------------------------------------------------------------------------

    def _what_if(self, request: WhatIf.Request, response: WhatIf.Response) -> WhatIf.Response:
        try:
            note = self._answer(request, response)
            response.outcome = conversions.ok(note)
        except Exception as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'siblings/what_if: {response.outcome.message}')
        return response

    def _answer(self, request: WhatIf.Request, response: WhatIf.Response) -> str:
        """Fill the forecasts of a proposal and of the present rates; return a note on them.

        Raises:
            InputError: the proposal is wrong, or no photograph has come yet.
        """
        if not self.siblings.started:
            raise InputError('no photograph has come yet; ask again after the first one')
        horizon = conversions.seconds_from_msg(request.horizon) or self._ahead()
        steps = conversions.plan_from_msg(request.proposed)
        check_steps(steps)
        check_proposal(steps, horizon, self._rig)
        with self._changed:
            held = self._rates.plan(self.siblings.time, horizon)
        plan = proposed_plan(steps, held, self._producer)
        check_balance(plan, held, self._rig)
        note = concentration_note([held, plan], self._rig)
        present = self._forecast
        if present is None or not present.answers(self.siblings.time, held, horizon):
            present = self._outlook(held, horizon, quick=True)
        response.present = self._as_message(present)
        response.proposed = self._as_message(self._outlook(plan, horizon, quick=True))
        return note

    def _as_message(self, outlook: Outlook) -> Forecast:
        balance = None
        with suppress(InputError):  # a water table that does not settle
            balance = water_balance(self._rig, self.siblings.grid, outlook.plan[0].rates)
        return forecast_to_msg(outlook, self.siblings.grid, str(balance or ''))

    def _cost_gradient(
        self, request: CostGradient.Request, response: CostGradient.Response
    ) -> CostGradient.Response:
        try:
            found = self._expected_cost(request)
            response.cost = found.cost
            if found.gradient is not None:
                response.gradient = np.ravel(found.gradient).tolist()
            response.outcome = conversions.ok()
        except Exception as error:
            response.outcome = conversions.refusal(error)
            self.get_logger().error(f'siblings/cost_gradient: {response.outcome.message}')
        return response

    def _expected_cost(self, request: CostGradient.Request) -> ScheduleCost:
        """Return the cost and gradient that some siblings expect on average.

        They stand for equal shares of all, in the order of the tracer that they expect in the zone.

        Raises:
            InputError: the request is wrong, or no forecast has been made yet.
        """
        if self._forecast is None:
            raise InputError('no forecast has been made yet; ask again after the first photograph')
        initial, grid = conversions.tracer_from_msg(request.initial)
        plan = conversions.plan_from_msg(request.schedule)
        horizon = conversions.seconds_from_msg(request.horizon)
        reached = [step for step in plan if step.start < horizon]
        check_proposal(reached, horizon, self._rig)
        chosen = chosen_judges(self._forecast.ranked, self._judges)
        orders = self.siblings.cost_orders(
            chosen,
            initial,
            plan,
            horizon=horizon,
            terms=[conversions.cost_term_from_msg(term, grid) for term in request.terms],
            with_gradient=request.with_gradient,
        )
        return expected_cost(orders, self._quick, worst_share=self._worst_share)


def _learning_executor(scheduler: str, workers: int, tell: Callable[[str], Any]) -> Executor:
    """Return the executor of the siblings: the cluster of a `scheduler`, or patient threads.

    Threads also follow a scheduler that goes away; `tell` then gets a line.

    Raises:
        InputError: there is no scheduler at that address.
    """

    def patient_threads() -> Executor:
        return ThreadCrew(workers, _be_patient)

    if not scheduler:
        return patient_threads()
    return LastingCrew(crew(scheduler=scheduler), patient_threads, tell)


def _be_patient() -> None:
    """Lower the priority of this thread; Linux keeps one for each."""
    os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), YIELDING)


def main() -> None:
    """Run the node, unless other siblings are there."""
    run(only_one(SiblingsNode, 'siblings'))


if __name__ == '__main__':
    main()
