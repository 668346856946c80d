"""The exposure time that a camera wrote into a photograph.

It is EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, in newer
cameras, `OffsetTimeOriginal`. Without an offset the time is local time of this machine.
"""

import io
import warnings
from datetime import datetime, timedelta, timezone

from PIL import Image

from porotwin_core.errors import InputError

_EXIF_DIRECTORY = 0x8769
_ORIGINAL_TAG, _SUBSECOND_TAG, _OFFSET_TAG = 0x9003, 0x9291, 0x9011
HEADER_BYTES = 1 << 18
"""Bytes that contain the EXIF data, which lies in the first 64 kB of a JPEG."""


def exif_time(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` [s since 1970, UTC], None if it has none.

    Raises:
        InputError: the camera wrote an impossible time.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a large or damaged file; decoding judges it
            image = Image.open(io.BytesIO(data[:HEADER_BYTES]))
        with image:
            tags = image.getexif().get_ifd(_EXIF_DIRECTORY)
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return None
    written = str(tags.get(_ORIGINAL_TAG, '')).strip('\0 ')
    try:
        moment = datetime.strptime(written, '%Y:%m:%d %H:%M:%S')
    except ValueError:
        return None
    offset = str(tags.get(_OFFSET_TAG, '')).strip('\0 ')
    try:
        seconds = moment.replace(tzinfo=_zone(offset)).timestamp()
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"EXIF time '{written}{offset}' is impossible; set the camera's clock"
        ) from None
    digits = str(tags.get(_SUBSECOND_TAG, '')).strip('\0 ')
    return seconds + (float('0.' + digits) if digits.isdecimal() else 0.0)


def _zone(offset: str) -> timezone | None:
    """Return the zone written as `+01:00`, or None for local time.

    Raises:
        ValueError: the offset is a day or more.
    """
    try:
        sign, hours, minutes = offset[0], int(offset[1:3]), int(offset[4:6])
    except (IndexError, ValueError):
        return None
    shift = timedelta(hours=hours, minutes=minutes)
    return timezone(-shift if sign == '-' else shift)
