"""Photographs as files: is this one whole, how large is it, and its pixels at a reduced scale.

Pixels are in the order of the file: a camera turned by hand between two photographs writes another
EXIF orientation, but the corners of the rig are known in the pixels of its sensor.
"""

import io
import struct
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from porotwin_core.errors import InputError

JPEG_START = b'\xff\xd8'
JPEG_END = b'\xff\xd9'
PNG_START = b'\x89PNG\r\n\x1a\n'
PNG_END = b'IEND\xaeB`\x82'
TIFF_STARTS = (b'II*\x00', b'MM\x00*')
REDUCTIONS = {
    1: cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION,
    2: cv2.IMREAD_REDUCED_COLOR_2 | cv2.IMREAD_IGNORE_ORIENTATION,
    4: cv2.IMREAD_REDUCED_COLOR_4 | cv2.IMREAD_IGNORE_ORIENTATION,
    8: cv2.IMREAD_REDUCED_COLOR_8 | cv2.IMREAD_IGNORE_ORIENTATION,
}
_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_ORIENTATION = 0x0112
_UPRIGHT = 1
_TRAILING_BYTES = 64
"""Some cameras pad a finished JPEG with zeros; the end marker is looked for in this tail."""

DARK_LEVEL = 12
"""A photograph whose 99.5th percentile lies below this grey level shows nothing."""
BRIGHT_LEVEL = 250
"""Grey level from which a pixel counts as over-exposed."""
BRIGHT_SHARE = 0.5
"""A photograph with more over-exposed pixels than this share is refused."""


@dataclass(frozen=True)
class Photograph:
    """A decoded photograph: `pixels` (rows, columns, 3) uint8, blue-green-red, row 0 the top.

    `width`, `height` are those of the file; `reduction` is the whole number by which the decoded
    pixels are coarser. A point (column, row) of the file lies at `(point + 0.5) / reduction - 0.5`.
    """

    pixels: NDArray[np.uint8]
    width: int
    height: int
    reduction: int


def _pixels(data: bytes, reduction: int = 1) -> NDArray[np.uint8] | None:
    if data.startswith(TIFF_STARTS):
        data = _without_orientation(data)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), REDUCTIONS[reduction])
    except cv2.error:  # a damaged header may claim a size beyond what OpenCV reads
        return None
    return None if pixels is None else np.asarray(pixels, np.uint8)


def _without_orientation(tiff: bytes) -> bytes:
    """Return the TIFF with an upright orientation: OpenCV turns TIFFs whatever it is told."""
    order = '<' if tiff.startswith(b'II') else '>'
    try:
        (directory,) = struct.unpack_from(order + 'I', tiff, 4)
        (count,) = struct.unpack_from(order + 'H', tiff, directory)
        for entry in range(directory + 2, directory + 2 + 12 * count, 12):
            if struct.unpack_from(order + 'H', tiff, entry) == (_ORIENTATION,):
                upright = struct.pack(order + 'HH', _UPRIGHT, 0)
                return tiff[: entry + 8] + upright + tiff[entry + 12 :]
    except struct.error:  # damaged: the decoder says so
        pass
    return tiff


def orientation(data: bytes) -> int:
    """Return the EXIF orientation (1 to 8) of the photograph `data`; 1 where it has none."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            written = image.getexif().get(_ORIENTATION, _UPRIGHT)
    except Exception:  # a damaged header makes Pillow raise all kinds of errors
        return _UPRIGHT
    return written if written in range(1, 9) else _UPRIGHT


def is_whole(data: bytes) -> bool:
    """Return whether the file's content is complete: it ends as its format says it must."""
    if data.startswith(JPEG_START):
        tail = data[-_TRAILING_BYTES:].rstrip(b'\x00')
        return tail.endswith(JPEG_END)
    if data.startswith(PNG_START):
        return data.endswith(PNG_END)
    if data.startswith(TIFF_STARTS):
        return _pixels(data) is not None
    return False


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    position = 2
    while position + 9 < len(data):
        if data[position] != 0xFF:
            return None
        marker = data[position + 1]
        if marker == 0xFF:
            position += 1
            continue
        if marker in _JPEG_FRAME_MARKERS:
            height, width = struct.unpack('>HH', data[position + 5 : position + 9])
            return width, height
        position += 2 + int.from_bytes(data[position + 2 : position + 4], 'big')
    return None


def size(data: bytes) -> tuple[int, int]:
    """Return (width, height) in pixels from the file's header, without decoding.

    Raises:
        InputError: the content is no photograph, or it is broken.
    """
    found: tuple[int, int] | None = None
    if data.startswith(JPEG_START):
        found = _jpeg_size(data)
    elif data.startswith(PNG_START) and len(data) >= 24:
        found = struct.unpack('>II', data[16:24])
    elif data.startswith(TIFF_STARTS):
        pixels = _pixels(data)
        found = None if pixels is None else (pixels.shape[1], pixels.shape[0])
    if found is None or min(found) < 1:
        raise InputError(f'photograph of {len(data)} bytes: not a JPEG, PNG or TIFF; send it again')
    return found


def decode(data: bytes, reduction: int = 1) -> Photograph:
    """Return the photograph in `data`, decoded `reduction` (1, 2, 4, 8) times coarser.

    JPEG is decoded at the reduced scale itself, which costs a fraction of a full decode.

    Raises:
        InputError: the photograph is truncated or broken, black, or over-exposed.
    """
    width, height = size(data)
    if not is_whole(data):
        raise InputError(
            f'photograph of {len(data)} bytes is truncated: its end is missing; send it again'
        )
    pixels = _pixels(data, reduction)
    if pixels is None:
        raise InputError(f'photograph of {len(data)} bytes is broken; send it again')
    photograph = Photograph(pixels, width, height, reduction)
    refuse_without_picture(photograph)
    return photograph


def refuse_without_picture(photograph: Photograph) -> None:
    """Raise InputError for a photograph that is black or over-exposed as a whole."""
    sample = photograph.pixels[::4, ::4, 1]
    brightest = float(np.percentile(sample, 99.5))
    if brightest < DARK_LEVEL:
        raise InputError(
            f'photograph is black: 99.5 % of it below grey level {brightest:.0f} of 255; '
            'check lamp, lens cap and exposure'
        )
    bright = float(np.mean(sample >= BRIGHT_LEVEL))
    if bright > BRIGHT_SHARE:
        raise InputError(
            f'photograph is over-exposed: {100 * bright:.0f} % of it at full white; '
            'shorten the exposure'
        )
