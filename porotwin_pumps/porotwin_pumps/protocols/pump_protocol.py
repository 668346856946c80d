"""The interface of a pump's protocol: its methods, and its announcement.

A protocol is one module in this folder. It has a class with the methods of `Pump`, and announces
it: `PROTOCOL = PumpProtocol(name='new_era', open=open_pump)`. docs/pumps.md describes the rest.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from porotwin_core.basis.errors import InputError

ROUND_OFF = 2e-3
"""Allowed difference of a rate that is read back, as a share: pumps keep four digits."""


class PumpError(Exception):
    """A pump does not run as commanded; the message is one line with the reason."""


class PumpSilent(PumpError):  # noqa: N818  it is a state of the pump, not a mistake
    """A pump does not answer. It may well go on as it was set last."""


class Pump(Protocol):
    """One pump. Rates in [ml/h] and volumes in [ml] are positive into the rig."""

    def set_rate(self, rate_ml_h: float) -> None:
        """Run at `rate_ml_h` until the next command, and read the rate back.

        Raises:
            PumpError: it does not.
        """
        ...

    def check(self) -> None:
        """Check that the pump still runs as it was set last.

        Raises:
            PumpError: it does not.
        """
        ...

    def volume_ml(self) -> float:
        """Return the volume [ml] pumped into the rig, minus out of it, since the rate was set.

        Raises:
            PumpError: the pump gives no volume.
        """
        ...


def check_syringe(address: int, diameter_mm: float) -> None:
    """Check the address of a syringe pump on its line, and the inner diameter of its syringe [mm].

    Raises:
        InputError: one of both is wrong.
    """
    if not 0 <= address <= 99:
        raise InputError(f'address {address} of a pump: give 0 to 99')
    if not 0.1 <= diameter_mm <= 50.0:
        raise InputError(f'diameter_mm {diameter_mm:g} of a syringe: give 0.1 to 50')


@dataclass(frozen=True)
class PumpProtocol:
    """The announcement of a protocol.

    Attributes:
        name: its name in the pump file and the name of its module.
        open: `open(line, address, **options)` returns the pump at `address` on a serial line; it
            raises InputError for a wrong option and PumpError for a pump that does not answer.
        baud: default speed of the line [bit/s].
        frame: default frame of a byte: data bits, parity N, E or O, stop bits.
        options: keyword arguments of `open` with their meanings; each is a number.
        pretend: takes a clock [s] and returns a function, which answers a question like faultless
            pumps of any address on one line, for a dry run; None: there is no dry run.
    """

    name: str
    open: Callable[..., Pump]
    baud: int
    options: dict[str, str]
    pretend: Callable[[Callable[[], float]], Callable[[bytes], bytes]] | None = None
    frame: str = '8N1'
