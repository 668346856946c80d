"""Pretended devices on a Modbus line: registers that keep their values."""

from collections import defaultdict

from porotwin_pumps.pretended.motor import ClockFn


class PretendedRegisters:
    """Holding registers of devices of any address on one line, all 0 at first."""

    def __init__(self, _clock: ClockFn) -> None:
        """Begin with zeros."""
        from pymodbus.framer import FramerRTU
        from pymodbus.pdu import DecodePDU

        self.registers = defaultdict[int, defaultdict[int, int]](lambda: defaultdict(int))
        self._framer = FramerRTU(DecodePDU(True))

    def __call__(self, question: bytes) -> bytes:
        """Return the answer to a request; empty until it is whole."""
        from pymodbus.pdu.register_message import (
            ReadHoldingRegistersResponse,
            WriteMultipleRegistersResponse,
        )

        _, asked = self._framer.handleFrame(question, 0, 0)
        if asked is None:
            return b''
        own = self.registers[asked.dev_id]
        if asked.function_code == ReadHoldingRegistersResponse.function_code:
            places = range(asked.address, asked.address + asked.count)
            read = ReadHoldingRegistersResponse(
                registers=[own[place] for place in places], dev_id=asked.dev_id
            )
            return bytes(self._framer.buildFrame(read))
        own.update(enumerate(asked.registers, asked.address))
        count = len(asked.registers)
        written = WriteMultipleRegistersResponse(
            address=asked.address, count=count, dev_id=asked.dev_id
        )
        return bytes(self._framer.buildFrame(written))
