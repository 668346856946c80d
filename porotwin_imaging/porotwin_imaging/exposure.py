"""When a photograph was exposed: the camera's own word, else the protocol, else the file's time.

The camera writes it as EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, newer ones,
`OffsetTimeOriginal`; without an offset the time is taken as this machine's local time.
"""

import io
from datetime import datetime, timedelta, timezone

from PIL import Image

from porotwin_core.errors import InputError

_EXIF_IFD = 0x8769
_ORIGINAL, _SUBSECOND, _OFFSET = 0x9003, 0x9291, 0x9011
HEADER_BYTES = 1 << 18
"""EXIF stands at the start of a JPEG, within its first 64 kB."""
_LATEST = 2.0**31
"""A stamp counts seconds in 32 bits."""


def from_exif(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` in seconds since 1970 (UTC), or None.

    Raises:
        InputError: the camera wrote a time that cannot be.
    """
    try:
        with Image.open(io.BytesIO(data[:HEADER_BYTES])) as image:
            tags = image.getexif().get_ifd(_EXIF_IFD)
    except Exception:  # a damaged header makes Pillow raise all kinds of errors
        return None
    written = str(tags.get(_ORIGINAL, '')).strip('\0 ')
    try:
        moment = datetime.strptime(written, '%Y:%m:%d %H:%M:%S')
    except ValueError:
        return None
    offset = str(tags.get(_OFFSET, '')).strip('\0 ')
    try:
        seconds = moment.replace(tzinfo=_zone(offset)).timestamp()
    except (ValueError, OverflowError, OSError):
        raise InputError(
            f"EXIF time '{written}{offset}' cannot be; set the camera's clock"
        ) from None
    digits = str(tags.get(_SUBSECOND, '')).strip('\0 ')
    return seconds + (float('0.' + digits) if digits.isdecimal() else 0.0)


def _zone(offset: str) -> timezone | None:
    """Return the zone written as `+01:00`, or None for local time.

    Raises:
        ValueError: a day or more.
    """
    try:
        sign, hours, minutes = offset[0], int(offset[1:3]), int(offset[4:6])
    except (IndexError, ValueError):
        return None
    shift = timedelta(hours=hours, minutes=minutes)
    return timezone(-shift if sign == '-' else shift)


def exposure_time(data: bytes, protocol_time: float | None, file_time: float) -> float:
    """Return when a photograph was exposed [s]: from EXIF, else `protocol_time`, else `file_time`.

    Of `data` the first `HEADER_BYTES` are read. EXIF and file times count from 1970 (UTC), a
    protocol's from the start of its experiment.

    Raises:
        InputError: the time cannot be, or lies beyond what a stamp can hold.
    """
    found = from_exif(data)
    if found is None:
        found = file_time if protocol_time is None else protocol_time
    if not abs(found) < _LATEST:
        raise InputError(f'exposed at {found:g} s, which no stamp can hold; correct the clock')
    return found
