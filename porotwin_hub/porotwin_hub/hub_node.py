"""The hub as a node: messages into the inbox, cycles of the twin out of it.

Callbacks only convert and store. A worker thread takes one ready state after the other, so that a
slow cycle delays no message and a service call can wait without a deadlock.
"""

import math
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from porotwin_core import conversions, qos
from porotwin_core.correction import CorrectionFn
from porotwin_core.errors import InputError
from porotwin_core.grid import Grid
from porotwin_core.node import Diagnostics, declare, declare_grid, declare_rig, run
from porotwin_core.rig import Rig
from porotwin_core.wells import WellRates
from porotwin_hub.clients import Caller, DataDrivenModelClient, PhysicsModelClient, send_control
from porotwin_hub.controller import Controller
from porotwin_hub.forecast import ModelUnavailable, PhysicsModel
from porotwin_hub.freshness import PhotographClock
from porotwin_hub.hub import Hub
from porotwin_hub.inbox import ArrivedState, Inbox, ReadyState
from porotwin_hub.objective_registry import make_objective
from porotwin_hub.rates_in_force import KnownRates, balanced
from porotwin_hub.setpoint_expiry import SetpointDecision
from porotwin_hub.setpoint_limits import Limits
from porotwin_hub.twin import Cycle, Twin
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

OPTIMISER_SHARE = 0.5
"""Share of the photo interval that one optimisation may take: the rest is for the forecast."""


class HubNode(Node):
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
        self._grid = declare_grid(self, rig)
        control = declare(self, 'control', True, 'choose setpoints when rig.yaml allows it')
        self._wells = set(rig.wells)
        self._balancing_well = rig.control.producer if rig.control and rig.closed else None
        self._limits = Limits.of(rig) if control and rig.control is not None else None
        simulated = bool(self.get_parameter('use_sim_time').value)
        interval = declare(self, 'photo_interval_s', 30.0, 'time between photographs [s]')
        self._call = Caller(
            self, timeout=declare(self, 'model_timeout_s', 20.0, 'longest wait for a model [s]')
        )
        twin = Twin(
            physics or PhysicsModelClient(self._call, self._grid),
            data_driven or DataDrivenModelClient(self._call, self._grid),
            photo_interval=interval,
            controller=self._controller(
                rig,
                self._grid,
                # simulated time waits for the twin, and the result must not depend on the machine
                patience=math.inf if simulated else OPTIMISER_SHARE * interval,
            ),
            assumed=Limits.of(rig).safe() if rig.control is not None else None,
        )
        # seconds since 1970 that go on steadily when this machine's clock is set
        epoch = time.time() - time.monotonic()

        def clock() -> float:
            return epoch + time.monotonic()

        self._inbox: Inbox[NewState] = Inbox(
            clock, clock_tolerance=math.inf if simulated else twin.validity
        )
        self._hub = Hub(
            twin,
            limits=self._limits,
            photographs=(
                None if simulated else PhotographClock(interval=interval, validity=twin.validity)
            ),
            clock=clock,
        )
        self._diagnostics = Diagnostics(self)
        self._setpoints = 0
        self._make_topics()
        self._rig_publisher.publish(conversions.rig_to_msg(rig))
        if self._limits is None:
            self._log_prediction_only(rig)
        threading.Thread(target=self._work, daemon=True).start()

    def _controller(self, rig: Rig, grid: Grid, *, patience: float) -> Controller | None:
        horizon = declare(self, 'horizon_s', 1800.0, 'how far the optimiser looks ahead [s]')
        evaluations = declare(self, 'evaluations', 60, 'predictions per optimisation')
        if self._limits is None:
            return None
        objective = make_objective(rig, grid)
        return Controller(self._limits, objective, horizon, evaluations, patience)

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
        self.create_subscription(WellRatesMessage, 'wells/measured', self._on_measured, qos.FIELD)
        self.create_subscription(CleanState, 'asset/clean_state', self._on_clean_state, qos.FIELD)
        self.create_subscription(NewState, 'asset/new_state', self._on_new_state, qos.FIELD)
        self.create_subscription(
            StateRefreshed, 'asset/state_refreshed', self._on_refreshed, qos.FIELD
        )

    # --- messages in --------------------------------------------------------------------------

    def _on_measured(self, message: WellRatesMessage) -> None:
        try:
            rates = conversions.rates_from_msg(message.wells)
            self._refuse_unknown_wells(rates)
        except InputError as error:
            self.get_logger().error(f'measured rates ignored: {error}')
            return
        if self._balancing_well is not None:
            rates = balanced(rates, self._balancing_well)
        start = conversions.time_from_msg(message.start)
        end = conversions.time_from_msg(message.header.stamp)
        self._inbox.add_rates(KnownRates(start, end, rates))

    def _refuse_unknown_wells(self, rates: WellRates) -> None:
        unknown = sorted(set(rates) - self._wells)
        if unknown:
            raise InputError(
                f"well '{unknown[0]}' is not in rig.yaml; known: {', '.join(sorted(self._wells))}"
            )

    def _on_clean_state(self, message: CleanState) -> None:
        stamp = conversions.time_from_msg(message.header.stamp)
        self._inbox.add_interruption(stamp, message.reason)

    def _on_new_state(self, message: NewState) -> None:
        try:
            concentration, grid = conversions.tracer_from_msg(message.tracer)
            self._refuse_other_grid(grid)
        except InputError as error:
            self.get_logger().error(f'state {message.sequence} ignored: {error}')
            return
        stamp = conversions.time_from_msg(message.header.stamp)
        self._inbox.add_state(ArrivedState(message.sequence, stamp, concentration, message))

    def _refuse_other_grid(self, grid: Grid) -> None:
        if grid != self._grid:
            raise InputError(
                f'its map is {grid} over {grid.width} x {grid.height} m, the hub works on '
                f'{self._grid} over {self._grid.width} x {self._grid.height} m; start both alike'
            )

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
                cycle = self._hub.run(ready, self._send)
                self._publish(cycle, ready.state.envelope)
            except Exception as error:
                # the loop outlives any one photograph
                self.get_logger().error(f'state {sequence} failed: {error!r}')
                self._diagnostics.report(DiagnosticStatus.ERROR, f'cycle failed: {error!r}')

    def _log_sequence_of_time(self, ready: ReadyState[NewState]) -> None:
        if ready.time_went_back:
            self.get_logger().warning(
                f'time went back to {ready.state.stamp:.3f} s: beginning anew'
            )
        for reason in ready.interruptions:
            self.get_logger().info(f'time sequence interrupted: {reason}')

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
        self._inbox.supersede_confirmed_rates()
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


def report_of(cycle: Cycle, state: NewState) -> CycleReport:
    """Return the report of a cycle that began with the message `state`."""
    decision, forecast = cycle.decision, cycle.forecast
    return CycleReport(
        header=state.header,
        sequence=state.sequence,
        prediction_error=cycle.prediction_error,
        corrected_error=cycle.corrected_error,
        disallowed_tracer=cycle.disallowed_tracer,
        objective_unchanged=decision.cost_unchanged if decision else math.nan,
        objective=decision.cost if decision else math.nan,
        objective_evaluations=decision.evaluations if decision else 0,
        corrected=forecast is not None and forecast.is_corrected,
        correction_status=forecast.correction_status if forecast else 'no forecast',
        predict_duration=cycle.durations.get('predict', math.nan),
        correct_duration=cycle.durations.get('correct', math.nan),
        optimise_duration=cycle.durations.get('optimise', math.nan),
        cycle_duration=cycle.durations['cycle'],
        remarks=[*cycle.remarks, *cycle.notes],
    )


def main() -> None:
    """Run the node."""
    run(HubNode)


if __name__ == '__main__':
    main()
