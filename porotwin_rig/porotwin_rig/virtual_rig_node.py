"""The virtual rig as a node: the physical asset of the graph, in lock-step with the twin.

It publishes a photograph, waits for the setpoint with the stamp of this photograph, pumps it for
one photo interval, and publishes the next photograph. The result does not depend on the speed of
the machine.
"""

import array
import threading
import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock as RclpyClock
from rclpy.clock import ClockType
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import POLL_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.following import follow
from porotwin_core.ros.node import (
    CLOCK,
    Diagnostics,
    TwinNode,
    declare,
    declare_photo_interval,
    declare_rig,
    run,
)
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_msgs.msg import CleanState, CycleReport, WellRates
from porotwin_msgs.srv import Control, Ping
from porotwin_recording.tables.concentration import ConcentrationWriter
from porotwin_rig.camera import camera_before
from porotwin_rig.effects import EFFECTS, parse_effects
from porotwin_rig.mock_camera_node import SETTLE_S
from porotwin_rig.pumps import Pumps
from porotwin_rig.render import Photographer
from porotwin_rig.session import AssetSession, parse_speed
from porotwin_rig.virtual_rig import VirtualRig


class VirtualRigNode(TwinNode):
    """The asset's devices: camera, pumps with flow meters, and the clock of the experiment."""

    def __init__(self, **kwargs: Any) -> None:
        """Read parameters and fill the tank.

        Raises:
            InputError: a parameter, the rig or an effect is wrong.
        """
        own = Parameter(CLOCK, value=True)
        overrides = [*kwargs.pop('parameter_overrides', ()), own]
        super().__init__('virtual_rig', parameter_overrides=overrides, **kwargs)
        rig = declare_rig(self)
        interval = declare_photo_interval(self)
        duration = declare(self, 'duration_s', 4800.0, 'end of the experiment [s]')
        self._start = declare(
            self, 'start_s', 0.0, 'time of the first photograph; safe rates until then [s]'
        )
        self._interval = _positive('photo_interval_s', interval)
        self._duration = _positive('duration_s', duration)
        if not 0.0 <= self._start < self._duration:
            raise InputError(
                f"parameter 'start_s' of the virtual rig: {self._start:g}; give a time from 0 to "
                f'before the end at {self._duration:g} s'
            )
        self._pace = parse_speed(
            declare(self, 'speed', 'max', 'max, or the speed relative to real time')
        )
        self._patience = declare(
            self, 'lock_step_timeout_s', 60.0, 'longest wait for a setpoint, wall time [s]'
        )
        self._start_patience = declare(
            self, 'startup_timeout_s', 90.0, 'longest wait for the graph [s]'
        )
        self._waits_for_mend = declare(
            self,
            'wait_for_mend',
            False,
            'also wait for mend/seen: diagnoses take no simulated time',
        )
        needed = 'solver/predict,costa/corrective_source,guard/control'
        needed = declare(self, 'wait_for_services', needed, 'services to wait for at the start')
        self._needed = [self.resolve_service_name(name) for name in filter(None, needed.split(','))]
        self._session = self._make_session(rig)
        self._truth = self._make_truth(rig)
        self._diagnostics = Diagnostics(self)
        self._answered = threading.Condition()
        self._answered_stamp: int | None = None
        self._seen_stamp: int | None = None
        self._make_topics()
        self._worker = threading.Thread(target=self._work, daemon=True)
        self._worker.start()

    def _make_session(self, rig: Rig) -> AssetSession:
        seed = declare(self, 'seed', 7, 'seed of the sand, the camera and its noise', at_least=0)
        form = f'NAME:PARAMETER=VALUE,...;... with NAME one of {", ".join(EFFECTS)}'
        effects = parse_effects(declare(self, 'effects', '', f'true effects: {form}'))
        for name in (effect.name for effect in effects):
            if name in EFFECTS and EFFECTS[name].needs_recording:
                raise InputError(f"effect '{name}': not on a live rig; make a recording instead")
        width = declare(
            self,
            'photo_width_px',
            1600,
            'width of the photographs [px]',
            at_least=100,
            at_most=20_000,
        )
        delivery = declare(
            self,
            'producer_delivery',
            0.99,
            'metered over commanded rate',
            at_least=0.0,
            at_most=2.0,
        )
        producer = rig.control.producer if rig.control is not None else None
        pumps = Pumps({producer: delivery}) if producer is not None else Pumps()
        camera = camera_before(rig, width)
        photographer = Photographer(rig, camera=camera, seed=seed)
        if rig.camera is not None and rig.camera != photographer.rig.camera:
            self.get_logger().warning('rig.yaml has the rig elsewhere in the photographs')
        asset = VirtualRig(rig, effects=effects, pumps=pumps)
        return AssetSession(asset, photographer, photo_interval=self._interval)

    def _make_truth(self, rig: Rig) -> ConcentrationWriter | None:
        path = declare(self, 'truth', '', 'file for the true maps, for scoring; empty: none')
        grid = declare(self, 'grid', str(rig.default_grid()), 'columns x rows of the true maps')
        if not path:
            return None
        return ConcentrationWriter(Path(path), Grid.parse(grid, rig.width_m, rig.height_m))

    def _make_topics(self) -> None:
        self._clock_topic = self.create_publisher(Clock, '/clock', 10)
        self._baseline = self.create_publisher(
            CompressedImage, 'camera/baseline/compressed', qos.BASELINE
        )
        self._photo = self.create_publisher(CompressedImage, 'camera/image/compressed', qos.PHOTO)
        self._measured = self.create_publisher(WellRates, 'wells/measured', qos.FIELD)
        self._clean = self.create_publisher(CleanState, 'asset/clean_state', qos.FIELD)
        follow(self, Header, 'mend/seen', self._on_seen, qos.FIELD)
        follow(self, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        self._guard = OnlyCaller(self, 'asset/control')
        self.create_service(Control, 'asset/control', self._on_control)
        self.create_service(Ping, 'asset/ping', self._on_ping)
        steady = RclpyClock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(POLL_S, self._publish_clock, clock=steady)

    # --- services -----------------------------------------------------------------------------

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        setpoint = request.setpoint
        with self._answered:
            try:
                self._guard.check(request)
                rates = conversions.rates_from_msg(setpoint.wells)
                until = conversions.time_from_msg(setpoint.valid_until)
                self._session.command(rates, valid_until=until)
            except InputError as error:
                response.outcome = conversions.refusal(error)
                self.get_logger().error(f'setpoint {setpoint.sequence} refused: {error}')
                return response
        self._answer(setpoint.header)
        response.outcome = conversions.ok()
        return response

    def _answer(self, header: Header) -> None:
        with self._answered:
            self._answered_stamp = conversions.nanoseconds_from_msg(header.stamp)
            self._answered.notify_all()

    def _on_cycle(self, message: CycleReport) -> None:
        """Go on also without a setpoint: the hub reports a photograph after its setpoint."""
        self._answer(message.header)

    def _on_seen(self, message: Header) -> None:
        with self._answered:
            self._seen_stamp = conversions.nanoseconds_from_msg(message.stamp)
            self._answered.notify_all()

    def _on_ping(self, request: Ping.Request, response: Ping.Response) -> Ping.Response:
        now = self._session.time
        response.name = 'virtual rig'
        response.version = __version__
        response.status = f'{now:.0f} of {self._duration:.0f} s'
        response.time = conversions.time_to_msg(now)
        return response

    # --- the experiment -----------------------------------------------------------------------

    def _work(self) -> None:
        try:
            self._publish_clock()
            self._publish_photo(self._baseline, self._session.baseline())
            self._session.advance_with_safe_rates(self._start)
            self._wait_for_graph()
            if self._start > 0.0:
                self._publish_measured(self._session.asset.measured_rates(), since=0.0)
            self._run_experiment()
        except Exception as error:  # a thread that fails must say so
            self.get_logger().fatal(f'experiment failed at {self._session.time:.0f} s: {error!r}')
            self._diagnostics.report(DiagnosticStatus.ERROR, f'experiment failed: {error!r}')
        finally:
            if self._truth is not None:
                self._truth.close()
        time.sleep(SETTLE_S)
        self.context.try_shutdown()

    def _run_experiment(self) -> None:
        due = time.monotonic()
        self._show()
        while self._session.time < self._duration - 1e-6 and self.context.ok():
            self._wait_for_setpoint()
            due += self._interval / self._pace if self._pace else 0.0
            measured = self._session.advance()
            time.sleep(max(0.0, due - time.monotonic()) if self._pace else 0.0)
            self._publish_clock()
            self._publish_measured(measured)
            self._show()
        self._wait_for_setpoint()
        self._clean.publish(
            CleanState(
                header=conversions.header_at(self._session.time),
                cause=CleanState.FINISHED,
                reason=f'the experiment of {self._duration:.0f} s is over',
            )
        )
        self.get_logger().info(f'finished after {self._session.time:.0f} s')

    def _show(self) -> None:
        """Take and publish the photograph of this moment, and keep the truth beside it."""
        now = self._session.time
        with self._answered:
            self._answered_stamp = None
        if self._truth is not None:
            self._truth.append(now, self._session.asset.concentration(self._truth.grid))
        self._publish_photo(self._photo, self._session.photograph())
        self._diagnostics.report(DiagnosticStatus.OK, f'photograph at {now:.0f} s')

    def _wait_for_setpoint(self) -> None:
        """Return when the setpoint of the last photograph is there, or the waiting time is over."""
        if self._patience <= 0.0:
            return
        wanted = round(self._session.time * 1e9)
        with self._answered:
            if self._answered.wait_for(lambda: self._is_answered(wanted), self._patience):
                return
        text = f'no setpoint for the photograph at {self._session.time:.0f} s: going on without'
        self.get_logger().warning(text)
        self._diagnostics.report(DiagnosticStatus.WARN, text)

    def _is_answered(self, stamp: int) -> bool:
        seen = not self._waits_for_mend or self._seen_stamp == stamp
        return seen and self._answered_stamp == stamp

    def _wait_for_graph(self) -> None:
        """Return when the photographs have a subscriber and the services of the twin are there."""
        deadline = time.monotonic() + self._start_patience
        missing = ['a subscriber of the photographs']
        while missing and time.monotonic() < deadline and self.context.ok():
            time.sleep(0.1)
            offered = {name for name, _ in self.get_service_names_and_types()}
            missing = [] if self._photo.get_subscription_count() else missing[:1]
            missing += [name for name in self._needed if name not in offered]
        if missing:
            self.get_logger().warning(f'starting without {", ".join(missing)}')
        time.sleep(SETTLE_S)

    # --- messages -----------------------------------------------------------------------------

    def _publish_clock(self) -> None:
        self._clock_topic.publish(Clock(clock=conversions.time_to_msg(self._session.time)))

    def _publish_photo(self, publisher: Any, jpeg: bytes) -> None:
        header = conversions.header_at(self._session.time, conversions.CAMERA_FRAME)
        publisher.publish(
            CompressedImage(header=header, format='jpeg', data=array.array('B', jpeg))
        )

    def _publish_measured(self, rates: dict[str, WellRate], since: float | None = None) -> None:
        now = self._session.time
        start = now - self._interval if since is None else since
        self._measured.publish(
            WellRates(
                header=conversions.header_at(now),
                start=conversions.time_to_msg(start),
                wells=conversions.rates_to_msg(rates),
            )
        )


def _positive(name: str, value: float) -> float:
    if not value > 0.0:
        raise InputError(f"parameter '{name}' of the virtual rig: {value:g}; give a positive one")
    return value


def main() -> None:
    """Run the node."""
    run(VirtualRigNode)


if __name__ == '__main__':
    main()
