"""JPEG files: segments, size, completeness, and pixels without a damaged byte that shows.

A decoder paints over what is missing. A progressive JPEG that was cut is a smooth picture of nearly
the right colours. So every scan must be there, and every remark of the decoder refuses the file.

Format: ITU-T T.81 (1992), annexes B and G.
"""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError

JPEG_START = b'\xff\xd8'
JPEG_END = b'\xff\xd9'
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of the segment that holds the size; the three exceptions are tables."""
_PROGRESSIVE = frozenset({0xC2, 0xC6, 0xCA, 0xCE})
"""Frames whose coefficients come in several scans, bit by bit."""
_SCAN = 0xDA
_END = JPEG_END[1]
_MARKER_IN_SCAN = re.compile(rb'\xff[^\x00\xff\xd0-\xd7]', re.DOTALL)
"""Markers that end the coded pixels: no stuffed byte (0), no restart marker (D0 to D7)."""
_COEFFICIENTS = 64
"""Coefficients of a block of 8 x 8 pixels."""

_INKS = ('CMYK', 'YCCK')
"""Colours of print, as the decoder names them."""
_REDUCED = {
    reduction: flag | cv2.IMREAD_IGNORE_ORIENTATION
    for reduction, flag in (
        (1, cv2.IMREAD_COLOR),
        (2, cv2.IMREAD_REDUCED_COLOR_2),
        (4, cv2.IMREAD_REDUCED_COLOR_4),
        (8, cv2.IMREAD_REDUCED_COLOR_8),
    )
}
"""OpenCV's flags for each reduction."""


class _Segment(NamedTuple):
    """A segment: its marker, and its bytes behind their length."""

    marker: int
    body: bytes


def _segments(data: bytes) -> Iterator[_Segment]:
    """Yield the segments of the first picture, as far as they are whole, its end included.

    They are walked by their lengths, because a preview in a segment has an end marker too.
    """
    position = len(JPEG_START)
    while position + 1 < len(data) and data[position] == JPEG_END[0]:
        marker = data[position + 1]
        if marker == JPEG_END[0]:  # a marker may be padded
            position += 1
            continue
        if marker == _END:
            yield _Segment(marker, b'')
            return
        start = position + 2
        position = start + int.from_bytes(data[start : start + 2], 'big')
        if position > len(data):
            return
        yield _Segment(marker, data[start + 2 : position])
        if marker == _SCAN:
            found = _MARKER_IN_SCAN.search(data, position)
            if found is None:
                return
            position = found.start()


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) from the first frame header of a JPEG; None if there is none."""
    for marker, body in _segments(data):
        if marker in _FRAMES and len(body) >= len('phhww'):
            return int.from_bytes(body[3:5], 'big'), int.from_bytes(body[1:3], 'big')
        if marker == _SCAN:
            break
    return None


def jpeg_fault(data: bytes) -> str:
    """Return what is missing in a JPEG, by its segments; '' if nothing is.

    Cameras append other data behind the end.
    """
    found = list(_segments(data))
    if not found or found[-1].marker != _END:
        ended = data.rstrip(b'\0').endswith(JPEG_END)
        return f'is {"broken: segments are damaged" if ended else "truncated: its end is missing"}'
    frame = next((segment for segment in found if segment.marker in _FRAMES), None)
    if frame is None:
        return 'has no header of a picture'
    scans = [segment.body for segment in found if segment.marker == _SCAN]
    missing = _missing_scans(frame, scans)
    return f'is incomplete: {missing}; it was cut, although it has an end' if missing else ''


def _missing_scans(frame: _Segment, scans: Sequence[bytes]) -> str:
    """Return which components the scans leave open; '' if there are none."""
    number = frame.body[5] if len(frame.body) > len('phhww') else 0
    components = frame.body[6 : 6 + 3 * number : 3]
    open_bits: dict[int, list[int | None]] = {each: [None] * _COEFFICIENTS for each in components}
    for scan in scans:
        count = scan[0] if scan else 0
        if len(scan) < 1 + 2 * count + 3:
            return 'the header of a scan is damaged'
        first, last, bits = scan[1 + 2 * count :][:3]
        if frame.marker not in _PROGRESSIVE:
            first, last, bits = 0, _COEFFICIENTS - 1, 0
        for each in scan[1 : 1 + 2 * count : 2]:
            if each in open_bits:
                span = range(first, min(last, _COEFFICIENTS - 1) + 1)
                open_bits[each] = [
                    bits & 0x0F if at in span else old for at, old in enumerate(open_bits[each])
                ]
    missing = sum(any(left != 0 for left in bits) for bits in open_bits.values())
    return f'scans of {missing} of {number} components are missing' if missing else ''


def jpeg_pixels(data: bytes, reduction: int) -> NDArray[np.uint8]:
    """Return blue-green-red pixels, 1 / `reduction` (1, 2, 4 or 8) of the size of the file.

    Raises:
        InputError: the decoder has found damage, or the colours are none of a photograph.
    """
    try:
        height, width, colours, _ = simplejpeg.decode_jpeg_header(data)
        size = {'min_height': -(-height // reduction), 'min_width': -(-width // reduction)}
        inks = colours in _INKS  # OpenCV alone turns them into red, green and blue
        pixels = simplejpeg.decode_jpeg(
            data, 'CMYK' if inks else 'BGR', **size, min_factor=reduction, strict=True
        )
        return np.asarray(
            cv2.imdecode(np.frombuffer(data, np.uint8), _REDUCED[reduction]) if inks else pixels
        )
    except (ValueError, MemoryError) as error:
        reason = ' '.join(str(error).split()) or 'too large'
        raise InputError(
            f'photograph of {len(data)} bytes is broken ({reason}); copy it again from the camera'
        ) from None
