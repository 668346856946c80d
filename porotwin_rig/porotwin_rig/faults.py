"""Faulty photographs on purpose, as cameras, cables and disks produce them."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError

Pixels = NDArray[np.uint8]


def _decoded(jpeg: bytes) -> Pixels:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)


def _encoded(pixels: Pixels) -> bytes:
    return bytes(cv2.imencode('.jpg', pixels)[1].tobytes())


def _halved(jpeg: bytes) -> bytes:
    pixels = _decoded(jpeg)
    return _encoded(pixels[::2, ::2].copy())


FAULTS: Mapping[str, Callable[[bytes], bytes]] = MappingProxyType(
    {
        'truncated': lambda jpeg: jpeg[: len(jpeg) // 2],
        'empty': lambda _: b'',
        'garbage': lambda jpeg: bytes(reversed(jpeg)),
        'black': lambda jpeg: _encoded(np.zeros_like(_decoded(jpeg))),
        'overexposed': lambda jpeg: _encoded(np.full_like(_decoded(jpeg), 255)),
        'half_size': _halved,
        'upside_down': lambda jpeg: _encoded(_decoded(jpeg)[::-1, ::-1].copy()),
    }
)
"""Faults of the bytes of a photograph, by name."""

ORDER_FAULTS = ('missing', 'duplicate', 'late')
"""Faults of the sequence: a photograph is missing, comes twice, or has an earlier stamp than the
last one."""


def parse_faults(text: str) -> dict[int, str]:
    """Return the faults written as `3:truncated,5:black`, by the number of the photograph.

    Raises:
        InputError: a number or the name of a fault is wrong.
    """
    faults: dict[int, str] = {}
    for part in filter(None, (piece.strip() for piece in text.split(','))):
        number, _, name = part.partition(':')
        if not number.isdigit() or (name not in FAULTS and name not in ORDER_FAULTS):
            raise InputError(
                f"fault '{part}': write NUMBER:NAME with one of "
                f'{", ".join((*FAULTS, *ORDER_FAULTS))}'
            )
        faults[int(number)] = name
    return faults
