"""Pumps of Harvard, Masterflex and Modbus obey, are measured, and tell their faults."""

import asyncio
import struct
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip('serial', reason='needs pyserial; set it up with ./porotwin')
pymodbus = pytest.importorskip('pymodbus', reason='needs pymodbus; pip install pymodbus')

from pump_line import PtyLine  # noqa: E402

from porotwin_core.basis.errors import InputError  # noqa: E402
from porotwin_pumps.protocols.protocol_registry import PROTOCOLS  # noqa: E402
from porotwin_pumps.protocols.pump_protocol import Pump, PumpError, PumpSilent  # noqa: E402
from porotwin_pumps.serial_line import SerialLine  # noqa: E402

MODBUS = {'rate_register': 10, 'run_register': 12, 'direction_register': 13,
          'volume_register': 14, 'ml_h_per_unit': 60.0}  # fmt: skip
OPTIONS: dict[str, dict[str, float]] = {
    'harvard': {'diameter_mm': 26.7},
    'masterflex': {'ml_per_turn': 0.8},
    'modbus_rtu': MODBUS,
}
NAMES = tuple(OPTIONS)


class Bench:
    """A pretended device at address 3 on a pseudo-terminal, with its clock [s]."""

    def __init__(self, name: str) -> None:
        self.name, self.now = name, 0.0
        pretend = PROTOCOLS[name].pretend
        assert pretend is not None
        self.device: Any = pretend(lambda: self.now)
        self.line = PtyLine(self.device)

    def pump(self, address: int = 3) -> Pump:
        protocol = PROTOCOLS[self.name]
        line = SerialLine(self.line.path, protocol.baud, frame=protocol.frame, timeout_s=0.3)
        return protocol.open(line, address, **OPTIONS[self.name])

    def running_ml_h(self) -> float:
        """Return how fast the device pumps [ml/h], into the rig positive."""
        if self.name != 'modbus_rtu':
            return self.device.pumps[3].running_ml_h * OPTIONS[self.name].get('ml_per_turn', 1.0)
        own = self.device.registers[3]
        (rate,) = struct.unpack('>f', struct.pack('>HH', own[10], own[11]))
        return own[12] * (-1.0 if own[13] else 1.0) * 60.0 * rate

    def let_pump(self, seconds: float) -> None:
        """Let the time pass; registers do not count by themselves."""
        self.now += seconds
        if self.name == 'modbus_rtu':
            own = self.device.registers[3]
            (before,) = struct.unpack('>f', struct.pack('>HH', own[14], own[15]))
            after = struct.pack('>f', before + abs(self.running_ml_h()) * seconds / 3600.0)
            own[14], own[15] = struct.unpack('>HH', after)


@pytest.fixture(params=NAMES)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param)
    yield made
    made.line.unplug()


def test_a_pump_runs_into_and_out_of_the_rig_and_its_volume_is_read(bench: Bench) -> None:
    pump = bench.pump()
    volume = pump.volume_ml()
    for rate_ml_h in (480.0, -240.0, 0.0, 960.0):
        pump.set_rate(rate_ml_h)
        assert bench.running_ml_h() == pytest.approx(rate_ml_h, rel=1e-3)
        bench.let_pump(900.0)
        pump.check()
        volume += rate_ml_h / 4.0
        assert pump.volume_ml() == pytest.approx(volume, rel=1e-3)


@pytest.mark.parametrize('fault', ['silent', 'partial', 'garbage'])
def test_a_line_that_fails_is_a_fault_and_the_pump_obeys_again(bench: Bench, fault: str) -> None:
    pump = bench.pump()
    bench.line.fault = fault
    with pytest.raises(PumpError) as caught:
        pump.set_rate(480.0)
    assert '\n' not in str(caught.value)
    assert isinstance(caught.value, PumpSilent) or fault == 'garbage'
    bench.line.fault = ''
    pump.set_rate(480.0)
    assert bench.running_ml_h() == pytest.approx(480.0)


def test_a_pump_that_was_stopped_by_hand_is_a_fault(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    pump = bench.pump()
    pump.set_rate(480.0)
    if bench.name == 'modbus_rtu':
        bench.device.registers[3][12] = 0
    elif bench.name == 'harvard':
        bench.device.pumps[3].prompt = ':'
    else:
        bench.device.pumps[3].running = False
        monkeypatch.setattr('time.monotonic', lambda: 1e12)
    with pytest.raises(PumpError, match='against its command'):
        pump.check()


def test_another_rate_than_the_commanded_one_is_a_fault(bench: Bench) -> None:
    pump = bench.pump()

    def other(answer: bytes) -> bytes:
        if bench.name == 'harvard':
            return answer.replace(b'8 ml/min', b'7 ml/min')
        return answer.replace(b'S+010.0', b'S+009.0')

    if bench.name == 'modbus_rtu':
        pump.set_rate(480.0)
        bench.device.registers[3][10] += 1
        with pytest.raises(PumpError, match='commanded 480 ml/h, it runs at'):
            pump.check()
        return
    bench.line.fault = other
    with pytest.raises(PumpError, match=r'commanded 480 ml/h, it runs at 420|it says 9 rpm'):
        pump.set_rate(480.0)


def test_faults_of_single_makes_are_told() -> None:
    harvard, masterflex, modbus = map(Bench, NAMES)
    try:
        pump = harvard.pump()
        with pytest.raises(PumpError, match=r"refuses 'irate 50.000000 ml/min': Argument error"):
            pump.set_rate(3000.0)
        harvard.device.pumps[3].prompt = '*'
        with pytest.raises(PumpError, match='its motor stalled'):
            pump.check()
        pump.set_rate(100.0)
        drive = masterflex.pump()
        with pytest.raises(PumpError, match='no speed that it can keep'):
            drive.set_rate(2.0)
        drive.set_rate(480.0)
        masterflex.let_pump(60.0)
        drive.volume_ml()
        masterflex.device.pumps.clear()
        with pytest.raises(PumpError, match='its counter went back'):
            drive.volume_ml()
        with pytest.raises(InputError, match=r'register 1.5: give a whole number'):
            PROTOCOLS['modbus_rtu'].open(None, 3, **{**MODBUS, 'run_register': 1.5})
        with pytest.raises(InputError, match='1 to 247'):
            modbus.pump(0)
    finally:
        for one in (harvard, masterflex, modbus):
            one.line.unplug()


def test_the_server_of_pymodbus_understands_us() -> None:
    from pymodbus import FramerType, simulator
    from pymodbus.server import ModbusSerialServer

    if not hasattr(simulator, 'DataType'):
        pytest.skip('the server of this test came with a later pymodbus')
    at_server = PtyLine(lambda said: at_client.say(said))
    at_client = PtyLine(lambda asked: at_server.say(asked))
    ready, loop = threading.Event(), asyncio.new_event_loop()
    stop: list[Callable[[], Any]] = []

    async def serve() -> None:
        device = simulator.SimDevice(
            3, simdata=[simulator.SimData(0, count=40, datatype=simulator.DataType.REGISTERS)]
        )
        server = ModbusSerialServer(
            device, framer=FramerType.RTU, port=at_server.path, baudrate=9600
        )
        stop.append(server.shutdown)
        await server.serve_forever(background=True)
        ready.set()
        await server.serving

    thread = threading.Thread(target=lambda: loop.run_until_complete(serve()), daemon=True)
    thread.start()
    assert ready.wait(20.0)
    line = SerialLine(at_client.path, 9600, frame='8E1', timeout_s=2.0)
    pump = PROTOCOLS['modbus_rtu'].open(line, 3, **MODBUS)
    pump.set_rate(-480.0)
    pump.check()
    assert pump.volume_ml() == 0.0
    with pytest.raises(PumpError, match='it refuses a request for register 50'):
        PROTOCOLS['modbus_rtu'].open(line, 3, **{**MODBUS, 'run_register': 50})
    asyncio.run_coroutine_threadsafe(stop[0](), loop).result(10.0)
    thread.join(10.0)
    at_client.unplug()
    at_server.unplug()
