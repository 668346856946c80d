"""Tests of the node of the pumps, with simulated pumps on a pseudo-terminal."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter

pytest.importorskip('serial', reason='needs pyserial; set it up with ./porotwin')

from patience import until
from pump_line import PumpLine

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.vouching import Voucher
from porotwin_msgs.msg import Outcome, Setpoint, WellRates
from porotwin_msgs.srv import Control
from porotwin_pumps.pumps_node import PumpsNode

pytestmark = pytest.mark.graph

SMALL_RIG = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'
WELLS = ('injector', 'producer', 'control1', 'control2', 'control3')
SAFE_ML_H = [500.0, -500.0, 0.0, 0.0, 0.0]


class Rack:
    """Five simulated pumps, their node, and a guard that this test plays."""

    def __init__(self, context: rclpy.Context, folder: Path) -> None:
        self.line = PumpLine(len(WELLS))
        entry = {'protocol': 'new_era', 'port': self.line.path, 'diameter_mm': 26.7,
                 'max_rate_ml_h': 1500.0}  # fmt: skip
        path = folder / 'pumps.yaml'
        pumps = {well: {**entry, 'address': number} for number, well in enumerate(WELLS)}
        path.write_text(yaml.safe_dump({'pumps': pumps}))
        overrides = [
            Parameter('rig', value=str(SMALL_RIG)),
            Parameter('pumps', value=str(path)),
            Parameter('measure_period_s', value=1.0),
        ]
        self.pumps = PumpsNode(context=context, parameter_overrides=overrides)
        self.guard = rclpy.create_node('guard', context=context)
        self.control = self.guard.create_client(Control, 'asset/control')
        self.voucher = Voucher(self.guard)
        self.measured: list[WellRates] = []
        self.health: list[str] = []
        self.guard.create_subscription(WellRates, 'wells/measured', self.measured.append, qos.FIELD)
        self.guard.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, 10)
        self._thread = NodeThread(self.pumps, self.guard, threads=4)
        until(self.control.service_is_ready)

    def close(self) -> None:
        self._thread.end()
        self.line.unplug()

    def _on_health(self, message: DiagnosticArray) -> None:
        self.health += [status.message for status in message.status]

    def running(self) -> list[float]:
        return [pytest.approx(pump.running_ml_h) for pump in self.line.pumps]

    def send(self, control1_ml_h: float, *, validity: float = 90.0) -> Outcome:
        ml_h = {'injector': 500.0, 'control1': control1_ml_h, 'producer': -500.0 - control1_ml_h}
        rates = {
            well: WellRate(from_ml_h(ml_h.get(well, 0.0)), float(well == 'injector'))
            for well in WELLS
        }
        now = time.time()
        setpoint = Setpoint(
            header=conversions.header_at(now),
            sequence=1,
            valid_until=conversions.time_to_msg(now + validity),
            wells=conversions.rates_to_msg(rates),
        )
        request = Control.Request(setpoint=setpoint)
        self.voucher.vouch('asset/control', request)
        future = self.control.call_async(request)
        until(future.done)
        return future.result().outcome


@pytest.fixture
def rack(domain: int, tmp_path: Path) -> Iterator[Rack]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    made = Rack(context, tmp_path)
    yield made
    made.close()


def test_setpoints_are_pumped_measured_and_end_in_safe_rates(rack: Rack) -> None:
    assert rack.running() == SAFE_ML_H
    assert rack.send(100.0).code == Outcome.OK
    assert rack.running() == [500.0, -600.0, 100.0, 0.0, 0.0]
    until(lambda: any(close_to(m, 'control1', 100.0) for m in rack.measured))
    stranger = rclpy.create_node('stranger', context=rack.guard.context)
    client = stranger.create_client(Control, 'asset/control')
    until(client.service_is_ready)
    assert '/stranger calls asset/control too' in rack.send(200.0).message
    stranger.destroy_node()
    until(lambda: rack.send(50.0, validity=1.5).code == Outcome.OK)
    until(lambda: rack.running() == SAFE_ML_H)
    until(lambda: any('ended and none followed' in line for line in rack.health))
    rack.line.silent = {3}
    until(lambda: any("the pump of 'control2'" in line for line in rack.health))
    assert "the pump of 'control2'" in rack.send(100.0).message
    rack.line.silent.clear()
    until(lambda: rack.send(100.0).code == Outcome.OK)


def close_to(message: WellRates, well: str, rate_ml_h: float) -> bool:
    rates = conversions.rates_from_msg(message.wells)
    return to_ml_h(rates[well].rate) == pytest.approx(rate_ml_h, rel=0.2)


def test_a_setpoint_ends_during_a_suspend_of_the_computer(
    rack: Rack, monkeypatch: pytest.MonkeyPatch
) -> None:
    slept, read = 0.0, time.clock_gettime
    monkeypatch.setattr(
        time, 'clock_gettime', lambda one: read(one) + slept * (one == time.CLOCK_BOOTTIME)
    )
    assert rack.send(100.0).code == Outcome.OK
    slept = 600.0
    until(lambda: rack.running() == SAFE_ML_H)
