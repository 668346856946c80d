"""The contract of a camera source: the records that it gives, and how it is announced.

A source is one module in this folder. It has a class with a method `poll`, and announces it:

    SOURCE = SourceKind(name='folder', address='path of a folder', open=open_folder)

`docs/extend/source.md` shows a complete example.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

Role = Literal['baseline', 'state']


@dataclass(frozen=True)
class CameraPhoto:
    """A photograph as the camera wrote it.

    Attributes:
        data: bytes of the JPEG, PNG or TIFF file.
        time: exposure time [s].
        name: name for messages, such as the name of the file.
        role: 'baseline' without tracer, 'state', or None if the source does not know. In that case
            the first usable photograph becomes the baseline.
    """

    data: bytes
    time: float
    name: str
    role: Role | None = None


@dataclass(frozen=True)
class PhotoProblem:
    """A photograph that cannot be sent.

    Attributes:
        name: name of the photograph or camera.
        reason: one line with the remedy.
    """

    name: str
    reason: str


class Polled(NamedTuple):
    """The result of one poll: new photographs in the order of exposure, and problems."""

    photos: list[CameraPhoto]
    problems: list[PhotoProblem]


class CameraSource(Protocol):
    """Gives each photograph once."""

    def poll(self) -> Polled:
        """Return the photographs since the last poll; quick if there are none."""
        ...


@dataclass(frozen=True)
class SourceOption:
    """An option of a source, a parameter of the camera node.

    Attributes:
        name: name of the parameter, and keyword argument of `SourceKind.open`.
        default: its default; the type of the parameter follows from it.
        description: help text with the unit.
    """

    name: str
    default: bool | int | float | str
    description: str


@dataclass(frozen=True)
class SourceKind:
    """The announcement of a source.

    Attributes:
        name: NAME in `--camera NAME:ADDRESS`.
        address: help text for the address.
        open: `open(address, **options)` returns the source, or raises InputError.
        options: further parameters of the camera node.
        poll_interval_s: time between two polls [s]; None if each poll takes a photograph, so that
            the interval between photographs applies.
    """

    name: str
    address: str
    open: Callable[..., CameraSource]
    options: tuple[SourceOption, ...] = ()
    poll_interval_s: float | None = None
