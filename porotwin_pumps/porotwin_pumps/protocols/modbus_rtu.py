"""Pumps and controllers with Modbus RTU: four values in holding registers that the manual names.

Source: Modbus over serial line, V1.02; pymodbus makes and reads the frames. Rate and volume are
32-bit floats in two registers, the high word first. Run is 1 or 0, direction 0 into the rig, 1 out
of it. Numbers of registers begin with 0.
"""

import struct
from collections.abc import Sequence
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_pumps.pretended.modbus_registers import PretendedRegisters
from porotwin_pumps.protocols._counter import SignedCounter
from porotwin_pumps.protocols.pump_protocol import ROUND_OFF, PumpError, PumpProtocol, PumpSilent
from porotwin_pumps.serial_line import LineError, SerialLine


class ModbusPump:
    """One device on a line."""

    def __init__(
        self,
        line: SerialLine,
        address: int,
        *,
        rate_register: float,
        run_register: float,
        direction_register: float,
        volume_register: float,
        ml_h_per_unit: float,
    ) -> None:
        """Stop the pump.

        Args:
            line: the serial line.
            address: of the device on the line, 1 to 247.
            rate_register: of the rate, in units of the device.
            run_register: of the order to run.
            direction_register: of the direction.
            volume_register: of the counted volume [ml], whatever its direction.
            ml_h_per_unit: the unit of the rate [ml/h], such as 60 for ml/min.

        Raises:
            InputError: the address or an option is wrong.
            PumpError: the device does not answer or refuses, or pymodbus is missing.
        """
        places = (rate_register, run_register, direction_register, volume_register)
        if not 1 <= address <= 247:
            raise InputError(f'address {address} of a Modbus device: give 1 to 247')
        if wrong := [place for place in places if place not in range(65536)]:
            raise InputError(f'register {wrong[0]:g}: give a whole number from 0 to 65535')
        if not ml_h_per_unit > 0.0:
            raise InputError(f'ml_h_per_unit {ml_h_per_unit:g}: give more than 0')
        try:
            from pymodbus.framer import FramerRTU
            from pymodbus.pdu import DecodePDU
        except ImportError:
            raise PumpError('pymodbus is missing; pip install pymodbus') from None
        self._line, self._address, self._unit = line, address, ml_h_per_unit
        self._rate, self._run, self._way, self._volume = map(int, places)
        self._framer = FramerRTU(DecodePDU(False))
        self._told = 0.0
        self._write(self._run, [0])
        self._counter = SignedCounter(lambda: self._float(self._volume), 1.0)

    @property
    def _direction(self) -> int:
        return (self._told > 0.0) - (self._told < 0.0)

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h`; see `Pump.set_rate`."""
        self._write(self._run, [0])
        self._counter.volume_ml(self._direction)
        self._told = rate_ml_h
        if rate_ml_h:
            self._write(self._way, [int(rate_ml_h < 0.0)])
            rate = struct.pack('>f', abs(rate_ml_h) / self._unit)
            self._write(self._rate, struct.unpack('>HH', rate))
            self._write(self._run, [1])
        self.check()

    def check(self) -> None:
        """Check that the pump runs as it was set; see `Pump.check`."""
        if self._read(self._run, 1)[0] != abs(self._direction):
            raise PumpError(f'it {"has stopped" if self._told else "runs"}, against its command')
        if not self._told:
            return
        if self._read(self._way, 1)[0] != int(self._told < 0.0):
            raise PumpError('it runs in the other direction')
        rate = self._float(self._rate) * self._unit
        if not abs(rate - abs(self._told)) <= ROUND_OFF * abs(self._told):
            raise PumpError(f'commanded {abs(self._told):g} ml/h, it runs at {rate:g} ml/h')

    def volume_ml(self) -> float:
        """Return the volume since the start; see `Pump.volume_ml`."""
        return self._counter.volume_ml(self._direction)

    def _float(self, register: int) -> float:
        value: float = struct.unpack('>f', struct.pack('>HH', *self._read(register, 2)))[0]
        return value

    def _read(self, register: int, count: int) -> Sequence[int]:
        from pymodbus.pdu.register_message import ReadHoldingRegistersRequest as Read

        found = self._ask(Read(address=register, count=count, dev_id=self._address)).registers
        if len(found) != count:
            raise PumpError(f'it answers {len(found)} registers when asked for {count}')
        return list(found)

    def _write(self, register: int, values: Sequence[int]) -> None:
        from pymodbus.pdu.register_message import WriteMultipleRegistersRequest as Write

        self._ask(Write(address=register, registers=list(values), dev_id=self._address))

    def _ask(self, request: Any) -> Any:
        """Return the answer to a request.

        Raises:
            PumpError: no answer, an answer that makes no sense, or a refusal.
        """

        def is_whole(answer: bytes) -> bool:
            return self._framer.handleFrame(answer, self._address, 0)[1] is not None

        try:
            answer = self._line.ask(self._framer.buildFrame(request), end=is_whole)
        except LineError as error:
            raise PumpSilent(str(error)) from None
        _, found = self._framer.handleFrame(answer, self._address, 0)
        if found is None or found.function_code & 0x7F != request.function_code:
            raise PumpError(f'it answers {answer!r}, which makes no sense')
        if found.isError():
            raise PumpError(f'it refuses a request for register {request.address}: {found}')
        return found


PROTOCOL = PumpProtocol(
    name='modbus_rtu',
    open=ModbusPump,
    baud=9600,
    frame='8E1',
    options={
        'rate_register': 'register of the rate',
        'run_register': 'register that lets the pump run',
        'direction_register': 'register of the direction',
        'volume_register': 'register of the counted volume',
        'ml_h_per_unit': 'unit of the rate [ml/h], such as 60 for ml/min',
    },
    pretend=PretendedRegisters,
)
