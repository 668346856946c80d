"""Pretended pumps on a pseudo-terminal, with faults of the line."""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable
from typing import Any

from porotwin_pumps.pretended.new_era_pumps import PretendedPump, PretendedPumps

FAULTS: dict[str, Callable[[bytes], bytes]] = {
    '': lambda said: said,
    'silent': lambda _: b'',
    'partial': lambda said: said[:3],
    'garbage': lambda said: b'\xff?!x' + said[-1:],
}
"""Faults of a line: each takes an answer and returns another."""


class PtyLine:
    """A pretended device on a pseudo-terminal; `path` is its name.

    The device answers nothing (b'') until a question is whole, and None if it never will. `fault`
    is a key of FAULTS, or a function.
    """

    def __init__(self, device: Callable[[bytes], bytes | None]) -> None:
        self._device = device
        self.fault: Any = ''
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        question = b''
        while not self._ended.is_set():
            ready, _, _ = select.select([self._master], [], [], 0.05)
            if not ready:
                question = b''  # nobody has answered it
                continue
            try:
                question += os.read(self._master, 256)
            except OSError:
                return
            answer = self._device(question)
            if answer:
                self.say(FAULTS.get(self.fault, self.fault)(answer))
            if answer != b'':
                question = b''

    def say(self, answer: bytes) -> None:
        """Send bytes to whoever asks."""
        os.write(self._master, answer)

    def unplug(self) -> None:
        """End the line, as when a cable is pulled."""
        self._ended.set()
        self._thread.join(5.0)
        os.close(self._master)
        os.close(self._slave)


class PumpLine(PtyLine):
    """Pumps of New Era with the addresses 0, 1, ... that were just switched on."""

    def __init__(self, count: int) -> None:
        device = PretendedPumps(time.monotonic)
        self.pumps: list[PretendedPump] = [device.pumps[number] for number in range(count)]
        for pump in self.pumps:
            pump.alarm = 'R'
        self.silent: set[int] = set()
        """Addresses of pumps that do not answer."""
        super().__init__(
            lambda question: b'' if int(question[:2]) in self.silent else device(question)
        )
