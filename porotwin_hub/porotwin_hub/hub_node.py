"""The hub as a node: messages into the inbox, cycles of the twin out of it.

Callbacks only convert and store. A worker thread takes one ready state after the other, so that a
slow cycle delays no message and a service call can wait without a deadlock.
"""

import math
import threading
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.freshness import PhotographClock
from porotwin_core.clock.stamps import steady_time
from porotwin_core.model.correction import CorrectionFn
from porotwin_core.model.state_filter import StateFilter
from porotwin_core.rates.delivered_rates import rate_deviations
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.foreign_words import FewWords
from porotwin_core.ros.model_effects import ToldEffects, follow_effects
from porotwin_core.ros.node import (
    REPORT_S,
    Diagnostics,
    TwinNode,
    declare,
    declare_grid,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.senders import SENDERS, check_senders, publishers
from porotwin_core.ros.single_instance import another_lives, only_one
from porotwin_hub.control.planner_parameters import PlannerParameters
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.estimation.rate_learning import RateLearner
from porotwin_hub.estimation.tracer_watch import TracerWatch
from porotwin_hub.loop.cycle import Cycle
from porotwin_hub.loop.cycle_report import report_of
from porotwin_hub.loop.door import Door, StateNumbers
from porotwin_hub.loop.hub import Hub
from porotwin_hub.loop.inbox import ArrivedState, Inbox, ReadyState
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.clients import (
    Caller,
    DataDrivenModelClient,
    PhysicsModelClient,
    send_control,
)
from porotwin_hub.models.forecast import ModelUnavailable, PhysicsModel
from porotwin_hub.operator.setpoint_expiry import SetpointDecision
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    NewState,
    RigDescription,
    Setpoint,
    StateRefreshed,
    TracerField,
)
from porotwin_msgs.msg import WellRates as WellRatesMessage
from porotwin_solver.effects import tracer_storage

SIMULATED_PATIENCE_S = 60.0
"""Least wait for a model in simulated time [s]: as long as the virtual rig waits for a setpoint."""


class HubNode(TwinNode):
    """Listens to the asset's states, asks the models, publishes forecasts and setpoints."""

    def __init__(
        self,
        *,
        physics: PhysicsModel | None = None,
        data_driven: CorrectionFn | None = None,
        **kwargs: Any,
    ) -> None:
        """Read the parameters and start the worker.

        Args:
            physics: the physics-based model; None: the service `solver/...`.
            data_driven: the data-driven model; None: the service `costa/...`.
            kwargs: for the node, such as `context` and `parameter_overrides`.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('hub', **kwargs)
        rig = declare_rig(self)
        self._rig, self._grid = rig, declare_grid(self, rig)
        self._door = Door(rig, self._grid)
        self._numbers = StateNumbers()
        self._known_limits = Limits.of(rig) if rig.control is not None else None
        self._simulated = self.simulated
        interval = declare_photo_interval(self)
        self._call = Caller(self, timeout=self._declare_timeout())
        self._planning = PlannerParameters(
            self, rig, self._grid, self._call, interval=interval, simulated=self._simulated
        )
        planner = self._planning.planner()
        self._rates = RateHistory.of(rig, 0.0 if self._simulated else None)
        state_filter = self._declare_filter(rig)
        twin = Twin(
            physics or PhysicsModelClient(self._call, self._grid),
            data_driven or DataDrivenModelClient(self._call, self._grid),
            photo_interval=interval,
            controller=planner,
            rates=self._rates,
            state_filter=state_filter,
            learner=self._declare_learner(rig) if state_filter is not None else None,
            watch=TracerWatch(rig, self._grid),
        )
        photographs = PhotographClock(interval=interval, validity=twin.validity)
        self._inbox: Inbox[NewState] = Inbox(
            steady_time,
            judge=None if self._simulated else photographs.judge,
            clock_tolerance=math.inf if self._simulated else twin.validity,
        )
        self._hub = Hub(
            twin,
            limits=self._known_limits,
            clock=self._inbox.now,
            most_age=math.inf if self._simulated else photographs.most_age,
        )
        self._twin = twin
        self._longest_cycle = math.inf if self._simulated else twin.validity
        self._diagnostics = Diagnostics(self, heard=('hub/cycle',))
        self._refusals = FewWords(self._tell_refusal, known=SENDERS)
        self._setpoints = 0
        self._effects: tuple[EffectDescription, ...] = ()
        self._model_changed = threading.Event()
        self._make_topics()
        self._rig_publisher.publish(conversions.rig_to_msg(rig))
        if planner is None:
            self._log_prediction_only(rig)
        threading.Thread(target=self._work, daemon=True).start()

    def _declare_filter(self, rig: Rig) -> StateFilter | None:
        estimate = declare(
            self,
            'state_estimate',
            'filter',
            'state that predictions start from: filter weighs photograph and prediction by their '
            'errors, photograph takes the map as it is',
            choices=('filter', 'photograph'),
        )
        if estimate == 'photograph':
            return None
        grid = self._grid
        return StateFilter(tracer_storage(rig, grid), (grid.dz, grid.dx))

    def _declare_learner(self, rig: Rig) -> RateLearner | None:
        learns = declare(
            self,
            'learn_rates',
            True,
            'learn the rate factor of each pump from photographs and meters, and predict with it',
        )
        if not learns:
            return None
        return RateLearner(rate_deviations(rig), self._grid, closed=rig.closed)

    def _declare_timeout(self) -> float:
        """Return the longest wait for a model [s].

        Simulated time waits for the twin, and the result must not depend on the machine.
        """

        def in_use(seconds: float) -> float:
            return max(seconds, SIMULATED_PATIENCE_S) if self._simulated else seconds

        def change(seconds: float) -> None:
            self._call.timeout = in_use(seconds)

        return in_use(
            declare(
                self,
                'model_timeout_s',
                20.0,
                'longest wait for a model [s]; in simulated time at least a minute',
                at_least=0.01,
                at_most=3600.0,
                on_change=change,
            )
        )

    def _log_prediction_only(self, rig: Rig) -> None:
        known = rig.control is not None
        pumps = 'at their fixed and safe rates' if known else 'not known, taken as off'
        self.get_logger().info(
            f'no control of wells: predicting only; until rates are measured or confirmed the '
            f'pumps are {pumps}'
        )

    def _make_topics(self) -> None:
        self._rig_publisher = self.create_publisher(RigDescription, 'rig/description', qos.CONFIG)
        self._predicted = self.create_publisher(TracerField, 'tracer/predicted', qos.FIELD)
        self._corrected = self.create_publisher(TracerField, 'tracer/corrected', qos.FIELD)
        self._report = self.create_publisher(CycleReport, 'hub/cycle', qos.FIELD)
        # The executor serves subscriptions in the order of their creation, one callback at a time:
        # rates that are here before a state are in the inbox before it.
        # a hub in real time takes nothing from a recording
        listen = partial(follow, self, refuse=self._refusals.tell)
        listen(WellRatesMessage, 'wells/measured', self._on_measured, qos.FIELD)
        listen(CleanState, 'asset/clean_state', self._on_clean_state, qos.FIELD)
        follow_effects(self, self._on_effects, refuse=self._refusals.tell)
        if not self._simulated:
            listen(Header, 'asset/experiment', self._on_experiment, qos.CONFIG)
        listen(NewState, 'asset/new_state', self._on_new_state, qos.FIELD)
        listen(StateRefreshed, 'asset/state_refreshed', self._on_refreshed, qos.FIELD)

    # --- messages in --------------------------------------------------------------------------

    def _on_measured(self, message: WellRatesMessage) -> None:
        start = conversions.time_from_msg(message.start)
        end = conversions.time_from_msg(message.header.stamp)
        rates = conversions.rates_from_msg(message.wells)
        known = self._door.known_rates(start, end, rates)
        if not self._inbox.is_near(end):
            self.get_logger().warning(
                f'measured rates stamped {end:.3f} s: neither the clock of the camera nor of this '
                'machine; they count from the last photograph on',
                throttle_duration_sec=REPORT_S,
            )
        self._inbox.add_rates(known)

    def _tell_refusal(self, line: str) -> None:
        self.get_logger().error(line)
        self._diagnostics.report(DiagnosticStatus.WARN, line)

    def _on_clean_state(self, message: CleanState) -> None:
        stamp = conversions.time_from_msg(message.header.stamp)
        self._inbox.add_interruption(stamp, message.reason)

    def _on_new_state(self, message: NewState) -> None:
        told = str(self._numbers.doubt(message.sequence) or '')  # a refused state is not a lost one
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            self._door.check_state(concentration, grid)
            deviation, systematic = (
                conversions.deviation_from_msg(values, grid)
                for values in (message.deviation, message.systematic)
            )
        except InputError as error:
            line = f'state {message.sequence} ignored: {error}'
            self._refusals.tell('asset/new_state', line)
            return
        stamp = conversions.time_from_msg(message.header.stamp)
        self._inbox.add_state(
            ArrivedState(
                message.sequence, stamp, concentration, message, told, deviation, systematic
            )
        )

    def _on_effects(self, told: ToldEffects) -> None:
        if told.effects != self._effects:
            self._effects = told.effects
            self._model_changed.set()

    def _on_experiment(self, message: Header) -> None:
        self._rates.told_start = conversions.time_from_msg(message.stamp)

    def _on_refreshed(self, message: StateRefreshed) -> None:
        self._inbox.add_refreshed(message.sequence)

    # --- cycles -------------------------------------------------------------------------------

    def _work(self) -> None:
        while self.context.ok():
            ready = self._inbox.take()
            assert ready is not None
            sequence = ready.state.sequence
            try:
                self._log_sequence_of_time(ready)
                changes = self._planning.take_changes()
                if changes:
                    self._twin.change_controller(self._planning.planner())
                self._follow_model()
                with self._diagnostics.busy(f'state {sequence}', self._longest_cycle):
                    cycle = self._hub.run(ready, self._send, objection=self._objection())
                cycle.remarks += [*changes, *self._foreign_meters()]
                self._publish(cycle, ready.state.envelope)
            except Exception as error:
                # the loop outlives any one photograph
                self.get_logger().error(f'state {sequence} failed: {error!r}')
                self._diagnostics.report(DiagnosticStatus.ERROR, f'cycle failed: {error!r}')

    def _follow_model(self) -> None:
        """Weigh tracer as the model with its other effects does; unknown ones change nothing."""
        if self._model_changed.is_set():
            self._model_changed.clear()
            try:
                self._twin.change_model(self._rig.with_effects(self._effects))
            except InputError as error:
                self.get_logger().warning(f'tracer is weighed without the new effects: {error}')

    def _log_sequence_of_time(self, ready: ReadyState[NewState]) -> None:
        if ready.time_went_back:
            self.get_logger().warning(
                f'time went back to {ready.state.stamp:.3f} s: beginning anew'
            )
        for reason in ready.interruptions:
            self.get_logger().info(f'time sequence interrupted: {reason}')

    def _objection(self) -> str:
        """Return why no setpoint may follow from any state now, or an empty string."""
        if another := another_lives(self):
            return another
        names = {sender.node for sender in publishers(self, 'asset/new_state')}
        if len(names) > 1:
            return (
                f'{" and ".join(sorted(names))} publish asset/new_state; stop one, or set '
                'ROS_DOMAIN_ID to another number to run two twins'
            )
        clocks = {one.topic_type for one in self.get_publishers_info_by_topic('/clock')}
        if not self._simulated and 'rosgraph_msgs/msg/Clock' in clocks:
            return 'a node publishes /clock: a replay; start the hub with use_sim_time for it'
        return ''

    def _foreign_meters(self) -> list[str]:
        """Return a remark if a foreign node could send measured rates, so that none are used."""
        self._refusals.look()
        try:
            check_senders(self, 'wells/measured')
        except InputError as error:
            return [f'measured rates are not used: {error}']
        return []

    def _send(self, decision: SetpointDecision, ready: ReadyState[NewState]) -> None:
        """Send a setpoint to the guard, which announces it and commands it to the asset.

        Raises:
            ModelUnavailable: the guard or the asset does not take it.
        """
        self._setpoints += 1
        message = Setpoint(
            header=ready.state.envelope.header,
            sequence=self._setpoints,
            valid_until=conversions.time_to_msg(decision.valid_until),
            wells=conversions.rates_to_msg(decision.rates),
            reason=decision.reason,
        )
        try:
            send_control(self._call, message)
        except ModelUnavailable as error:
            raise ModelUnavailable(f'setpoint {self._setpoints} not taken: {error}') from None

    # --- messages out -------------------------------------------------------------------------

    def _publish(self, cycle: Cycle, state: NewState) -> None:
        if cycle.forecast is not None:
            for publisher, values in (
                (self._predicted, cycle.forecast.predicted),
                (self._corrected, cycle.forecast.corrected),
            ):
                publisher.publish(
                    conversions.tracer_to_msg(values, self._grid, cycle.forecast.time)
                )
        self._report.publish(report_of(cycle, state))
        level = DiagnosticStatus.WARN if cycle.remarks else DiagnosticStatus.OK
        summary = '; '.join(cycle.remarks) or f'state {state.sequence} done'
        self._diagnostics.report(level, summary, cycle_duration_s=f'{cycle.durations["cycle"]:.3f}')
        if cycle.remarks:
            self.get_logger().warning(f'state {state.sequence}: {summary}')


def main() -> None:
    """Run the node, unless another hub controls the rig."""
    run(only_one(HubNode, 'hub'))


if __name__ == '__main__':
    main()
