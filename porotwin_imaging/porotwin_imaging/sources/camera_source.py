"""The contract of a camera source: the records that it gives, and how it is announced.

A source is one module in this folder. It has a class with a method `poll`, and announces it:

    SOURCE = SourceKind(name='folder', address='path of a folder', open=open_folder)

`docs/extend/source.md` shows a complete example.
"""

import math
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, runtime_checkable

from porotwin_core.basis.remark import Remark
from porotwin_imaging.photograph.photo_clock import TimeEvidence, Trust
from porotwin_imaging.photograph.sent_photos import SentPhoto

Role = Literal['baseline', 'state']


@dataclass(frozen=True)
class CameraPhoto:
    """A photograph as the camera wrote it.

    Attributes:
        data: bytes of the JPEG, PNG or TIFF file.
        time: exposure time by this computer's clock [s since 1970].
        name: name of the file, or a name for messages.
        role: 'baseline' without tracer, 'state', or None if the source does not know. In that case
            the first usable photograph becomes the baseline.
        evidence: times of the photograph that need not be right; None: `time` is right.
        mark: mark of an unchanged file; empty if the photograph is no file.
    """

    data: bytes
    time: float
    name: str
    role: Role | None = None
    evidence: TimeEvidence | None = None
    mark: tuple[int, ...] = ()


class Polled(NamedTuple):
    """The result of one poll.

    Attributes:
        photos: new photographs in the order of exposure.
        problems: photographs that cannot be sent; the key is the name of photograph or camera.
        absent: one line if the camera does not answer, else empty. It is asked again after a
            growing pause.
        remarks: lines for the log, such as the settings of the camera.
        arriving: whether a photograph seems to arrive just now, so that the next poll may find it.
    """

    photos: list[CameraPhoto]
    problems: list[Remark]
    absent: str = ''
    remarks: tuple[str, ...] = ()
    arriving: bool = False


class CameraSource(Protocol):
    """Gives each photograph once."""

    def poll(self) -> Polled:
        """Return the photographs since the last poll; quick if there are none."""
        ...


@runtime_checkable
class ResumableSource(Protocol):
    """A source that can leave out the photographs that were sent before a restart."""

    def resume(self, sent: Iterable[SentPhoto]) -> None:
        """Take note of the photographs that were sent."""
        ...


@runtime_checkable
class OrderingSource(Protocol):
    """A source that orders photographs by their times.

    Attributes:
        trust: the first time of a photograph that may be believed.
    """

    trust: Trust


def anything(address: str) -> None:
    """Accept every address."""


@dataclass(frozen=True)
class SourceOption:
    """An option of a source, a parameter of the camera node.

    Attributes:
        name: name of the parameter, and keyword argument of `SourceKind.open`.
        default: its default; the type of the parameter follows from it.
        description: help text with the unit.
        at_least: smallest value of a number.
        at_most: largest value of a number.
        choices: the allowed texts; empty: any.
    """

    name: str
    default: bool | int | float | str
    description: str
    at_least: float = -math.inf
    at_most: float = math.inf
    choices: Collection[str] = ()


@dataclass(frozen=True)
class SourceKind:
    """The announcement of a source.

    Attributes:
        name: NAME in `--camera NAME:ADDRESS`.
        address: help text for the address.
        open: `open(address, **options)` returns the source, or raises InputError. A camera that is
            absent is no error: `Polled.absent` tells it.
        check: `check(address)` raises InputError if the address is wrong or nothing is there.
        options: further parameters of the camera node.
        poll_interval_s: time between two polls [s]; None if each poll takes a photograph, so that
            the interval between photographs applies.
    """

    name: str
    address: str
    open: Callable[..., CameraSource]
    check: Callable[[str], None] = anything
    options: tuple[SourceOption, ...] = ()
    poll_interval_s: float | None = None
