"""The hub as a node: listens to the asset's states, asks the models, publishes and controls.

Callbacks only store what arrives; a worker thread takes one refreshed state after the other through
`twin.Twin`. When states come faster than cycles, the newest is taken and the skipped are named.
Topics keep no order between them, so an interruption counts by its stamp, not by its arrival.
"""

import math
import queue
import threading
import time
from collections import deque
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from porotwin_core import conversions, qos
from porotwin_core.errors import InputError
from porotwin_core.node import Diagnostics, declare, declare_grid, declare_rig, run
from porotwin_core.rig import Rig
from porotwin_core.wells import WellRate
from porotwin_hub.clients import Caller, DataDrivenModelClient, PhysicsModelClient, send_control
from porotwin_hub.control import Limits
from porotwin_hub.freshness import PhotographClock
from porotwin_hub.objective import Objective
from porotwin_hub.twin import Cycle, ModelUnavailable, Observation, SetpointDecision, Twin
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    NewState,
    RigDescription,
    Setpoint,
    StateRefreshed,
    TracerField,
    WellRates,
)

REMEMBERED = 16
"""States, and words that one is complete, kept until the other arrives."""


@dataclass(frozen=True)
class Refreshed:
    """A complete state, ready for a cycle."""

    state: NewState
    measured: dict[str, WellRate] | None
    arrival: float


class HubNode(Node):
    """Client of all devices; the one that decides."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and make the loop.

        Raises:
            InputError: a parameter or the rig description is wrong.
        """
        super().__init__('hub', **kwargs)
        rig = declare_rig(self)
        self._grid = declare_grid(self, rig)
        control = declare(self, 'control', True, 'choose setpoints when rig.yaml allows it')
        self._limits = Limits.of(rig) if control and rig.control is not None else None
        self._known_wells = set(rig.wells)
        self._simulated = bool(self.get_parameter('use_sim_time').value)
        self._twin = self._make_twin(rig)
        self._diagnostics = Diagnostics(self)
        self._setpoints = 0
        self._arrived: dict[int, NewState] = {}
        self._complete: deque[int] = deque(maxlen=REMEMBERED)
        self._matching = threading.Lock()
        self._measured: dict[str, WellRate] | None = None
        self._states: queue.Queue[Refreshed] = queue.Queue()
        self._interruptions: queue.Queue[CleanState] = queue.Queue()
        self._last_stamp = -math.inf
        self._make_topics()
        self._rig_publisher.publish(conversions.rig_to_msg(rig))
        if self._limits is None:
            known = rig.control is not None
            pumps = 'at their fixed and safe rates' if known else 'not known, taken as off'
            self.get_logger().info(
                f'no control of wells: predicting only; until rates are measured or confirmed the '
                f'pumps are {pumps}'
            )
        threading.Thread(target=self._work, daemon=True).start()

    def _make_twin(self, rig: Rig) -> Twin:
        timeout = declare(self, 'model_timeout_s', 20.0, 'longest wait for a model [s]')
        interval = declare(self, 'photo_interval_s', 30.0, 'time between photographs [s]')
        self._call = Caller(self, timeout=timeout)
        twin = Twin(
            PhysicsModelClient(self._call, self._grid),
            DataDrivenModelClient(self._call, self._grid),
            self._grid,
            photo_interval=interval,
            horizon=declare(self, 'horizon_s', 600.0, 'how far the optimiser looks ahead [s]'),
            evaluations=declare(self, 'evaluations', 60, 'predictions per optimisation'),
            limits=self._limits,
            objective=Objective(rig, self._grid) if self._limits is not None else None,
            # simulated time waits for the twin, and the result must not depend on the machine
            patience=math.inf if self._simulated else 0.5 * interval,
            assumed=Limits.of(rig).safe() if rig.control is not None else None,
        )
        self._photographs = PhotographClock(interval=interval, validity=twin.validity)
        # time since 1970 that goes on steadily when this machine's clock is set
        self._epoch = time.time() - time.monotonic()
        return twin

    def _make_topics(self) -> None:
        self._rig_publisher = self.create_publisher(RigDescription, 'rig/description', qos.CONFIG)
        self._predicted = self.create_publisher(TracerField, 'tracer/predicted', qos.FIELD)
        self._corrected = self.create_publisher(TracerField, 'tracer/corrected', qos.FIELD)
        self._setpoint = self.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
        self._report = self.create_publisher(CycleReport, 'hub/cycle', qos.FIELD)
        self.create_subscription(NewState, 'asset/new_state', self._on_new_state, qos.FIELD)
        self.create_subscription(
            StateRefreshed, 'asset/state_refreshed', self._on_refreshed, qos.FIELD
        )
        self.create_subscription(
            CleanState, 'asset/clean_state', self._interruptions.put, qos.FIELD
        )
        self.create_subscription(WellRates, 'wells/measured', self._on_measured, qos.FIELD)

    def _on_new_state(self, message: NewState) -> None:
        self._arrived[message.sequence] = message
        self._match()

    def _on_measured(self, message: WellRates) -> None:
        try:
            rates = conversions.rates_from_msg(message.wells)
        except InputError as error:
            self.get_logger().error(f'measured rates ignored: {error}')
            return
        unknown = sorted(set(rates) - self._known_wells)
        if unknown:
            self.get_logger().error(
                f"measured rates ignored: well '{unknown[0]}' is not in rig.yaml; "
                f'known: {", ".join(sorted(self._known_wells))}'
            )
            return
        self._measured = rates

    def _on_refreshed(self, message: StateRefreshed) -> None:
        self._complete.append(message.sequence)
        self._match()

    def _match(self) -> None:
        """Queue every state that is here and complete, whichever of the two was told first."""
        with self._matching:
            for sequence in [n for n in self._complete if n in self._arrived]:
                self._complete.remove(sequence)
                arrival = self._epoch + time.monotonic()
                self._states.put(Refreshed(self._arrived.pop(sequence), self._measured, arrival))
            for sequence in [*self._arrived][:-REMEMBERED]:
                del self._arrived[sequence]

    def _work(self) -> None:
        while self.context.ok():
            event, skipped = self._states.get(), 0
            while not self._states.empty():
                event, skipped = self._states.get(), skipped + 1
            try:
                self._cycle(event, skipped)
            except InputError as error:
                self.get_logger().error(f'state {event.state.sequence} ignored: {error}')
            except Exception as error:
                # the loop outlives any one photograph
                self.get_logger().error(f'state {event.state.sequence} failed: {error!r}')
                self._diagnostics.report(DiagnosticStatus.ERROR, f'cycle failed: {error!r}')

    def _follow(self, stamp: float) -> None:
        """Make the loop forget what a state at `stamp` [s] does not follow from."""
        if stamp <= self._last_stamp:
            self._twin.begin_anew()
            self.get_logger().warning(f'time went back to {stamp:.3f} s: beginning anew')
            self._last_stamp = -math.inf
        early: list[CleanState] = []
        while not self._interruptions.empty():
            event = self._interruptions.get()
            moment = conversions.time_from_msg(event.header.stamp)
            if moment > stamp:
                early.append(event)
            elif moment > self._last_stamp:
                self._twin.interrupt()
                self.get_logger().info(f'time sequence interrupted: {event.reason}')
        for event in early:
            self._interruptions.put(event)
        self._last_stamp = stamp

    def _cycle(self, refreshed: Refreshed, skipped: int) -> None:
        begun = time.perf_counter()
        concentration, grid = conversions.tracer_from_msg(refreshed.state.tracer)
        if grid != self._grid:
            raise InputError(
                f'its map is {grid} over {grid.width} x {grid.height} m, the hub works on '
                f'{self._grid} over {self._grid.width} x {self._grid.height} m; start both alike'
            )
        stamp = conversions.time_from_msg(refreshed.state.header.stamp)
        self._follow(stamp)
        late = self._lateness(stamp, refreshed.arrival)
        steer = late <= self._twin.validity
        observation = Observation(stamp, concentration)
        cycle = self._twin.decide(observation, refreshed.measured, steer=steer)
        cycle.durations['cycle'] = time.perf_counter() - begun
        if not steer and self._limits is not None:
            age = timedelta(seconds=round(late))
            cycle.remarks.append(f'no setpoint: the photograph was taken {age} ago (h:mm:ss)')
        if cycle.setpoint is not None:
            self._send(cycle.setpoint, refreshed.state, cycle)
        self._twin.look_ahead(cycle)
        if cycle.setpoint is None:
            cycle.durations['cycle'] = time.perf_counter() - begun
        if skipped:
            cycle.remarks.append(f'{skipped} older states skipped: cycles are slower than photos')
        self._publish(cycle, refreshed.state)

    def _lateness(self, stamp: float, arrival: float) -> float:
        """Return how long ago a photograph was taken [s]; 0 in simulated time, which waits."""
        if self._simulated:
            return 0.0
        waited = self._epoch + time.monotonic() - arrival
        return self._photographs.lateness(stamp, arrival) + waited

    def _publish(self, cycle: Cycle, state: NewState) -> None:
        if cycle.forecast is not None:
            for publisher, values in (
                (self._predicted, cycle.forecast.predicted),
                (self._corrected, cycle.forecast.corrected),
            ):
                publisher.publish(
                    conversions.tracer_to_msg(values, self._grid, cycle.forecast.time)
                )
        self._report.publish(self._report_of(cycle, state))
        level = DiagnosticStatus.WARN if cycle.remarks else DiagnosticStatus.OK
        summary = '; '.join(cycle.remarks) or f'state {state.sequence} done'
        self._diagnostics.report(level, summary, cycle_duration_s=f'{cycle.durations["cycle"]:.3f}')
        if cycle.remarks:
            self.get_logger().warning(f'state {state.sequence}: {summary}')

    def _send(self, decision: SetpointDecision, state: NewState, cycle: Cycle) -> None:
        assert self._limits is not None
        broken = self._limits.violations(decision.rates)
        if broken:
            raise RuntimeError(f'setpoint withheld: {"; ".join(broken)}')
        self._setpoints += 1
        message = Setpoint(
            header=state.header,
            sequence=self._setpoints,
            valid_until=conversions.time_to_msg(decision.valid_until),
            wells=conversions.rates_to_msg(decision.rates),
            reason=decision.reason,
        )
        # what was measured or confirmed so far was pumped before this
        self._measured = None
        self._setpoint.publish(message)
        try:
            send_control(self._call, message)
        except ModelUnavailable as error:
            self._twin.not_taken(cycle)
            cycle.remarks.append(f'setpoint {self._setpoints} not taken: {error}')

    def _report_of(self, cycle: Cycle, state: NewState) -> CycleReport:
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
            remarks=cycle.remarks,
        )


def main() -> None:
    """Run the node."""
    run(HubNode)


if __name__ == '__main__':
    main()
