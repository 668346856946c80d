"""A serial line: one question at a time, each with an answer or a timeout."""

import errno
import os
from collections.abc import Callable
from typing import Any

GONE: tuple[type[Exception], ...] = (OSError,)
"""Errors of pyserial when a line is gone."""

try:
    import termios
except ImportError:  # Windows
    pass
else:
    GONE += (termios.error,)

ANSWER_TIMEOUT_S = 0.5
"""Longest wait for the next byte [s]: a pump answers within a tenth of it."""

LONGEST_ANSWER = 256
"""Most bytes of an answer: pumps send short lines."""


WholeFn = Callable[[bytes], bool]
"""Returns whether an answer is whole."""


class LineError(Exception):
    """A serial line is gone, or no device answers; the message is one line."""


class SerialLine:
    """The line at `path`; several pumps with different addresses may share it."""

    def __init__(
        self, path: str, baud: int, *, frame: str = '8N1', timeout_s: float = ANSWER_TIMEOUT_S
    ) -> None:
        """Name the line; the first question opens it, and the first one after a fault.

        Args:
            path: name of the port.
            baud: speed [bit/s].
            frame: data bits, parity N, E or O, and stop bits.
            timeout_s: longest wait for the next byte [s].
        """
        self.path = path
        self._baud, self._frame = baud, frame
        self._timeout_s = timeout_s
        self._port: Any = None

    def _opened(self) -> Any:
        if self._port is not None:
            return self._port
        try:
            import serial  # here, so that a graph without pumps runs without it
        except ImportError:
            raise LineError('pyserial is missing; pip install pyserial') from None
        try:
            # exclusive: two programs that talk on one line confuse every pump
            self._port = serial.Serial(
                self.path,
                self._baud,
                bytesize=int(self._frame[0]),
                parity=self._frame[1],
                stopbits=int(self._frame[2]),
                timeout=self._timeout_s,
                write_timeout=self._timeout_s,
                exclusive=True,
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            number = getattr(error, 'errno', None)
            reason = os.strerror(number) if number else str(error)
            if number == errno.EAGAIN:
                reason = 'another program uses it'
            raise LineError(f'{self.path}: cannot be opened ({reason}); check the cable') from None
        return self._port

    def ask(self, question: bytes, *, end: bytes | WholeFn) -> bytes:
        """Return the answer to `question`.

        Any byte of `end` ends an answer; a function tells whether an answer is whole.
        Bytes that came before the question are dropped, because they answer an older question.
        After a fault the next question opens the line again.

        Raises:
            LineError: the line is gone, or no whole answer came in time.
        """
        port = self._opened()
        is_whole = end if callable(end) else lambda answer: bool(answer) and answer[-1] in end
        try:
            port.reset_input_buffer()
            port.write(question)
            answer = self._read_until(port, is_whole)
        except GONE as error:
            self.close()
            raise LineError(f'{self.path}: the line is gone ({error})') from None
        if not is_whole(answer):
            said = f'only {answer!r} came' if answer else 'nothing came'
            raise LineError(f'{self.path}: no answer within {self._timeout_s:g} s, {said}')
        return answer

    @staticmethod
    def _read_until(port: Any, is_whole: WholeFn) -> bytes:
        answer = b''
        while not is_whole(answer) and len(answer) < LONGEST_ANSWER:
            byte = port.read(1)
            if not byte:
                break
            answer += byte
        return answer

    def close(self) -> None:
        """Close the line."""
        if self._port is not None:
            self._port.close()
            self._port = None
