"""When a photograph was exposed: the camera's own word, else the protocol, else the file's time.

The camera writes it as EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, newer ones,
`OffsetTimeOriginal`; without an offset the time is taken as this machine's local time.
"""

import io
from datetime import datetime, timedelta, timezone
from pathlib import Path

from PIL import Image, UnidentifiedImageError

_EXIF_IFD = 0x8769
_ORIGINAL, _SUBSECOND, _OFFSET = 0x9003, 0x9291, 0x9011
_HEADER_BYTES = 1 << 18
"""EXIF stands at the start of a JPEG, within its first 64 kB."""


def from_exif(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` in seconds since 1970 (UTC), or None."""
    try:
        with Image.open(io.BytesIO(data[:_HEADER_BYTES])) as image:
            tags = image.getexif().get_ifd(_EXIF_IFD)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return None
    try:
        moment = datetime.strptime(str(tags[_ORIGINAL]).strip('\0 '), '%Y:%m:%d %H:%M:%S')
    except (KeyError, ValueError):
        return None
    seconds = moment.replace(tzinfo=_zone(str(tags.get(_OFFSET, '')))).timestamp()
    digits = str(tags.get(_SUBSECOND, '')).strip('\0 ')
    return seconds + (float('0.' + digits) if digits.isdigit() else 0.0)


def _zone(offset: str) -> timezone | None:
    """Return the zone written as `+01:00`, or None for local time."""
    try:
        sign, hours, minutes = offset[0], int(offset[1:3]), int(offset[4:6])
    except (IndexError, ValueError):
        return None
    shift = timedelta(hours=hours, minutes=minutes)
    return timezone(-shift if sign == '-' else shift)


def exposure_time(data: bytes, protocol_time: float | None, path: Path | None) -> float:
    """Return when a photograph was exposed [s]: from EXIF, else `protocol_time`, else its file.

    EXIF and file times count from 1970 (UTC), a protocol's from the start of its experiment.
    """
    found = from_exif(data)
    if found is not None:
        return found
    if protocol_time is not None:
        return protocol_time
    if path is None:
        raise ValueError('a photograph without EXIF or protocol needs its file')
    return path.stat().st_mtime
