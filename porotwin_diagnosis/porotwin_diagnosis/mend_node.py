"""The node that mends the running twin: asks for diagnoses, makes offers, and judges effects.

The thread that takes the answers of a diagnosis also asks for it. A worker runs the shadow
forecasts, so that no message and no answer of the operator waits for them. While the solver takes
effects, messages wait in their queues.
"""

import os
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import DAY_S, MINUTE_S
from porotwin_core.clock.freshness import stamp_doubts
from porotwin_core.clock.periods import END_S, POLL_S
from porotwin_core.rig import EffectDescription
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
from porotwin_core.ros.senders import LONGEST_SEARCH_S, check_servers, goals_of
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_core.ros.single_instance import only_one
from porotwin_core.ros.vouching import OnlyCaller, Voucher
from porotwin_diagnosis.mending.finding import read_finding
from porotwin_diagnosis.mending.mender import Mender, MendSettings, model_maker
from porotwin_diagnosis.mending.offer_book import Offer
from porotwin_diagnosis.mending.state_periods import StatePeriods
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    MendOffer,
    NewState,
    Outcome,
)
from porotwin_msgs.srv import AnswerMend, SetEffects
from porotwin_solver.model.presets import PRESETS
from porotwin_solver.service.effects_in_force import checked_effects

NICENESS = 5
"""Increase of the process's nice value: a shadow forecast may be late, a setpoint may not."""

DIAGNOSE = 'diagnosis/diagnose'
"""Action of the diagnosis node."""

SOLVER_S = 30.0
"""Longest wait for the solver to change its model [s]; the factorisation of a large grid takes
ten."""


class _Asked(NamedTuple):
    """A diagnosis that is under way.

    run: number of the experiment that it looks at.
    seen: time of the newest photograph when it began [s].
    began: when it began, by `time.monotonic` [s].
    given: the effects that were in force.
    """

    run: int
    seen: float
    began: float
    given: tuple[EffectDescription, ...]


class MendNode(TwinNode):
    """Offers sure verdicts of the diagnosis; lets an accepted effect act in the model."""

    def __init__(self, **kwargs: Any) -> None:
        """Read the parameters, and begin to listen.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('mend', **kwargs)
        self._rig = rig = declare_rig(self)
        self._grid = declare_grid(self, rig)
        preset = declare(
            self, 'preset', 'fast', 'preset of the solver, for shadow forecasts', choices=PRESETS
        )
        self._longest_s = declare(
            self,
            'longest_s',
            900.0,
            'longest time of a diagnosis; it is then cancelled [s]',
            at_least=1.0,
            at_most=DAY_S,
        )
        self._lockstep = declare(
            self,
            'lockstep',
            False,
            'for a virtual rig: send mend/seen only after a running diagnosis and an open offer',
        )
        simulated = self.simulated
        self._doubt = stamp_doubts(declare_photo_interval(self), simulated=simulated)
        settings = self._declare_settings()
        self._lock = threading.RLock()
        self._mender = Mender(
            model_maker(rig, self._grid, preset),
            settings,
            set_effects=self._set_effects,
            publish=self._publish,
            say=self.get_logger().info,
        )
        self._states = StatePeriods(rig)
        self._run = 0
        self._wanted = ''
        self._asked: _Asked | None = None
        self._goal: Any = None
        self._overdue = False
        self._held: list[Header] = []
        self._known_sequence = -1
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._diagnostics = Diagnostics(self)
        self._connect()
        self._worker = threading.Thread(target=self._do_work, daemon=True)
        self._worker.start()

    def _declare_settings(self) -> MendSettings:
        return MendSettings(
            every_s=MINUTE_S
            * declare(
                self,
                'every_min',
                20.0,
                'time between two diagnoses [min]; earlier when forecasts become worse than '
                'expected',
                at_least=1.0,
                at_most=1e6,
            ),
            least_confidence=declare(
                self,
                'least_confidence',
                0.9,
                'least confidence of a verdict that is offered',
                at_least=0.5,
                at_most=1.0,
            ),
        )

    def _connect(self) -> None:
        self._offers = self.create_publisher(MendOffer, 'mend/offer', qos.CONFIG)
        self._seen = self.create_publisher(Header, 'mend/seen', qos.FIELD)
        follow_run(
            self,
            rates=self._states.rates,
            lock=self._lock,
            on_state=self._on_state,
            on_clean_state=self._on_clean,
            on_effects=self._on_effects,
        )
        follow(self, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        answers = MutuallyExclusiveCallbackGroup()
        self._people = OnlyCaller(self, 'mend/answer')
        self.create_service(AnswerMend, 'mend/answer', self._on_answer, callback_group=answers)
        self._voucher = Voucher(self)
        self._solver = self.create_client(
            SetEffects, 'solver/set_effects', callback_group=MutuallyExclusiveCallbackGroup()
        )
        # one group: an answer cannot overtake the note that it is due
        asking = MutuallyExclusiveCallbackGroup()
        self._diagnosis = ActionClient(self, Diagnose, DIAGNOSE, callback_group=asking)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(POLL_S, self._look, callback_group=asking, clock=steady)

    # --- messages in --------------------------------------------------------------------------

    def _on_clean(self, message: CleanState) -> None:
        if message.cause in (CleanState.START, CleanState.FINISHED):
            self._run += 1
            self._work.put(self._mender.begin_anew)
        else:
            self._work.put(self._mender.interrupt)

    def _on_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            if grid != self._grid:
                raise InputError(f'map on {grid}; the twin runs on {self._grid}')
            stamp = conversions.time_from_msg(message.header.stamp)
            if doubt := self._doubt(stamp):  # one wrong stamp would end the run
                raise InputError(doubt)
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')
            return
        if self._states.is_other_clock(stamp):
            self._run += 1
            self._work.put(self._mender.begin_anew)
        with self._lock:
            periods = self._states.until(stamp)
        self._work.put(lambda: self._mender.see(concentration, periods))

    def _on_cycle(self, message: CycleReport) -> None:
        self._work.put(lambda: self._after_cycle(message))

    def _after_cycle(self, message: CycleReport) -> None:
        stamp = conversions.time_from_msg(message.header.stamp)
        reason = self._mender.occasion(stamp, message.prediction_error, message.expected_error)
        if reason and self._asked is None:
            self._wanted = reason
        self._held.append(message.header)
        if not self._lockstep:
            self._release()

    def _on_effects(self, told: ToldEffects) -> None:
        checked_effects(self._rig, told.effects)
        self._known_sequence = told.sequence
        # behind whatever has set them, so that the mender knows its own
        self._work.put(lambda: self._solver_tells(told))

    def _solver_tells(self, told: ToldEffects) -> None:
        if told.sequence == self._known_sequence:
            # a solver begins with number 0
            self._mender.solver_tells(told.effects, is_new=told.sequence == 0)

    # --- the worker ---------------------------------------------------------------------------

    def destroy_node(self) -> None:
        """End the worker; Python complains about a thread that waits at its end."""
        self._work.put(None)
        self._worker.join(END_S)
        super().destroy_node()

    def _do_work(self) -> None:
        while (work := self._work.get()) is not None and self.context.ok():
            try:
                with self._lock:
                    work()
            except Exception as error:  # nothing here may stop the loop
                self.get_logger().error(f'mend: {error!r}')
                self._diagnostics.report(DiagnosticStatus.ERROR, f'mend failed: {error!r}')

    # --- the diagnosis ------------------------------------------------------------------------

    def _look(self) -> None:
        """Ask for a wanted diagnosis; end one that takes too long or whose node is gone."""
        with self._lock:
            if self._asked is not None:
                self._look_after_diagnosis()
            elif self._wanted:
                self._ask()
            if self._lockstep and self._asked is None and not self._mender.waits:
                self._release()

    def _ask(self) -> None:
        reason, self._wanted = self._wanted, ''
        if not self._diagnosis.server_is_ready():
            self._give_up('no diagnosis: its node does not run; it is asked again later')
            return
        if foreign := self._foreign():
            self._give_up(f'no diagnosis: {foreign}; it is asked again later')
            return
        newest = self._states.newest
        if newest is None:
            self._give_up(
                'no diagnosis: the hub works, but no map has been taken here; is the parameter '
                f'grid, {self._grid}, right for the maps?'
            )
            return
        self.get_logger().info(f'diagnosing the run so far: {reason}')
        self._diagnostics.report(DiagnosticStatus.OK, f'diagnosing: {reason}')
        self._asked = _Asked(self._run, newest, time.monotonic(), self._mender.in_force)
        self._overdue = False
        goal = Diagnose.Goal()
        self._voucher.vouch(goals_of(DIAGNOSE), goal)
        sent = self._diagnosis.send_goal_async(goal)
        sent.add_done_callback(partial(self._on_goal, self._asked))

    def _foreign(self) -> str:
        """Return what another node does that offers diagnoses too; '' for none."""
        try:
            check_servers(self, goals_of(DIAGNOSE))
        except InputError as error:
            return str(error)
        return ''

    def _on_goal(self, asked: _Asked, future: Any) -> None:
        goal = future.result()
        if self._asked is not asked:  # given up before
            if goal.accepted:
                self._voucher.cancel(DIAGNOSE, goal)
            return
        if not goal.accepted:
            self._give_up('no verdict: the diagnosis node refused; it is asked again later')
            return
        self._goal = goal
        goal.get_result_async().add_done_callback(partial(self._on_result, asked))

    def _look_after_diagnosis(self) -> None:
        assert self._asked is not None
        if not self._diagnosis.server_is_ready():
            self._give_up('no verdict: the diagnosis node has ended; it is asked again later')
        elif foreign := self._foreign():
            self._cancel()
            self._give_up(f'no verdict: {foreign}; it is asked again later')
        elif time.monotonic() - self._asked.began > self._longest_s and not self._overdue:
            self._overdue = True
            self._cancel()
            self._give_up(f'no verdict within {self._longest_s:g} s; the diagnosis is cancelled')

    def _cancel(self) -> None:
        if self._goal is not None:
            self._voucher.cancel(DIAGNOSE, self._goal)

    def _give_up(self, line: str) -> None:
        self._asked = self._goal = None
        self.get_logger().warning(line)
        self._diagnostics.report(DiagnosticStatus.WARN, line)

    def _on_result(self, asked: _Asked, future: Any) -> None:
        if self._asked is not asked:
            return  # given up before
        self._asked = self._goal = None
        if foreign := self._foreign():
            self._give_up(f'no verdict: {foreign}; it is asked again later')
            return
        result = future.result().result
        if result.outcome.code != Outcome.OK:
            self._give_up(f'no verdict: {result.outcome.message}')
            return
        if not result.report:  # what a server answers whose work failed
            self._give_up('no verdict: the diagnosis ended without a report')
            return
        if asked.run != self._run:
            self._give_up(f'the verdict {result.verdict} came after its run; it is not offered')
            return
        try:
            finding = read_finding(Path(result.report))
        except InputError as error:
            self._give_up(f'no verdict: {error}')
            return
        words = f'{finding.verdict}, confidence {finding.confidence:.2f}'
        self._diagnostics.report(DiagnosticStatus.OK, words)
        took = time.monotonic() - asked.began
        self.get_logger().info(f'{words}, after {took:.0f} s: {result.report}')
        with self._lock:
            now = asked.seen if self._states.newest is None else self._states.newest
            self._mender.found(finding, seen=asked.seen, now=now, given=asked.given)

    # --- the operator -------------------------------------------------------------------------

    def _on_answer(
        self, request: AnswerMend.Request, response: AnswerMend.Response
    ) -> AnswerMend.Response:
        try:
            self._people.check(request)
            with self._lock:
                self._mender.answer(request.sequence, accept=request.accept)
            response.outcome = conversions.ok()
        except TimeoutError as error:
            response.outcome = Outcome(code=Outcome.NOT_READY, message=str(error))
        except Exception as error:
            response.outcome = conversions.refusal(error)
        if response.outcome.code != Outcome.OK:
            self.get_logger().error(f'mend/answer: {response.outcome.message}')
        return response

    # --- messages out -------------------------------------------------------------------------

    def _set_effects(self, effects: tuple[EffectDescription, ...]) -> None:
        """Let `effects` act in the solver.

        Raises:
            InputError: the solver refuses them, or another node offers its service.
            TimeoutError: it is absent or silent.
        """
        if not self._solver.wait_for_service(timeout_sec=LONGEST_SEARCH_S):
            raise TimeoutError('the solver does not run; answer again when it does')
        request = SetEffects.Request(effects=[conversions.effect_to_msg(one) for one in effects])
        self._voucher.vouch('solver/set_effects', request)
        response = twin_answer_within(self, self._solver, request, SOLVER_S)
        if response is None:
            raise TimeoutError(f'the solver did not answer within {SOLVER_S:g} s; answer again')
        outcome = response.outcome
        if outcome.code == Outcome.NOT_READY:
            raise TimeoutError(f'the solver: {outcome.message}')
        if outcome.code != Outcome.OK:
            raise InputError(f'the solver refuses: {outcome.message}')

    def _publish(self, offer: Offer) -> None:
        finding = offer.finding
        self._offers.publish(
            MendOffer(
                header=conversions.header_at(offer.stamp),
                sequence=offer.sequence,
                state=offer.state.value,
                effects=[conversions.effect_to_msg(one) for one in finding.effects],
                confidence=finding.confidence,
                error_before=finding.error_before,
                error_after=finding.error_after,
                sentence=offer.sentence,
                report=finding.report,
            )
        )

    def _release(self) -> None:
        """Tell that all is done for the photographs so far."""
        held, self._held = self._held, []
        for header in held:
            self._seen.publish(header)


def main() -> None:
    """Run the node at a lower priority."""
    os.nice(NICENESS)  # before any thread starts, because each inherits the value
    run(only_one(MendNode, 'mend'))


if __name__ == '__main__':
    main()
