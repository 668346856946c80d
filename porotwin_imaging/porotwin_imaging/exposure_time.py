"""The exposure time of a photograph: from EXIF, otherwise from the protocol or the file.

The camera writes the time as EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, in newer
cameras, `OffsetTimeOriginal`. Without an offset the time is local time of this machine.
"""

import io
from datetime import datetime, timedelta, timezone

from PIL import Image

from porotwin_core.errors import InputError

_EXIF_DIRECTORY = 0x8769
_ORIGINAL_TAG, _SUBSECOND_TAG, _OFFSET_TAG = 0x9003, 0x9291, 0x9011
HEADER_BYTES = 1 << 18
"""Bytes that contain the EXIF data, which lies in the first 64 kB of a JPEG."""
_LATEST = 2.0**31
"""A ROS time stamp counts seconds in 32 bits."""


def exif_time(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` [s since 1970, UTC], None if it has none.

    Raises:
        InputError: the camera wrote an impossible time.
    """
    try:
        with Image.open(io.BytesIO(data[:HEADER_BYTES])) as image:
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


def exposure_time(data: bytes, protocol_time: float | None, file_time: float) -> float:
    """Return the exposure time [s]: from EXIF, otherwise `protocol_time`, otherwise `file_time`.

    Only the first `HEADER_BYTES` of `data` are read. EXIF and file times count from 1970 (UTC);
    protocol times count from the start of the experiment.

    Raises:
        InputError: the time is impossible, or too large for a time stamp.
    """
    found = exif_time(data)
    if found is None:
        found = file_time if protocol_time is None else protocol_time
    if not abs(found) < _LATEST:
        raise InputError(f'exposed at {found:g} s, too large for a time stamp; correct the clock')
    return found
