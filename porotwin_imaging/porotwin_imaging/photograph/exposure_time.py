"""The exposure time that a camera wrote into a photograph.

It is EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, in newer cameras,
`OffsetTimeOriginal`. Some cameras write `OffsetTimeDigitized` or `OffsetTime` instead. `OffsetTime`
belongs to `DateTime`, the last change of the file. It counts unless a program has changed the file
later. Without an offset the time is local time of this machine.
"""

import io
import re
import warnings
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import BinaryIO, NamedTuple

from PIL import Image
from PIL.ExifTags import IFD, Base

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import open_regular

_OFFSET = re.compile(r'([+-]\d\d):?(\d\d)')
"""Hours with their sign, and minutes; some programs leave the colon out."""
HEADER_BYTES = 1 << 18
"""Bytes that contain the EXIF data of a JPEG, which lies in its first 64 kB; a TIFF may have it at
its end."""


def exif_time(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` [s since 1970, UTC], None if it has none.

    The first `HEADER_BYTES` of a JPEG are enough.

    Raises:
        InputError: the camera wrote an impossible time.
    """
    written = _written(io.BytesIO(data))
    if written is None:
        return None
    try:
        seconds = written.moment.replace(tzinfo=_zone(written.offset)).timestamp()
    except (ValueError, OverflowError, OSError):
        original = str(written.moment).replace('-', ':') + written.offset
        raise InputError(f"EXIF time '{original}' is impossible; set the camera's clock") from None
    return seconds + (float('0.' + written.digits) if written.digits else 0.0)


def exif_words(path: Path) -> str:
    """Return the exposure time in the photograph `path` as 2024-05-31 14:30:00.25+02:00.

    Fraction and offset are left out where the camera wrote none; '' if it wrote no time.
    """
    try:
        with open_regular(path) as file:
            written = _written(file)
    except (OSError, InputError):
        return ''
    if written is None:
        return ''
    fraction = f'.{written.digits}' if written.digits else ''
    offset = _OFFSET.fullmatch(written.offset)
    return f'{written.moment}{fraction}{":".join(offset.groups()) if offset else ""}'


class _Written(NamedTuple):
    """What a camera wrote: local time, digits of the fraction of a second, offset from UTC."""

    moment: datetime
    digits: str
    offset: str


def _written(file: BinaryIO) -> _Written | None:
    """Return the exposure time in a photograph, None if it has none."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a large or damaged file; decoding judges it
            image = Image.open(file)
        with image:
            exif = image.getexif()
            tags = exif.get_ifd(IFD.Exif)
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return None
    original, digits, changed, *offsets = (
        str(tag or '').strip('\0 ')
        for tag in (
            tags.get(Base.DateTimeOriginal),
            tags.get(Base.SubsecTimeOriginal),
            exif.get(Base.DateTime),
            tags.get(Base.OffsetTimeOriginal),
            tags.get(Base.OffsetTimeDigitized),
            tags.get(Base.OffsetTime),
        )
    )
    if changed not in ('', original):
        offsets.pop()
    offset = next(filter(_OFFSET.fullmatch, offsets), next(filter(None, offsets), ''))
    try:
        moment = datetime.strptime(original, '%Y:%m:%d %H:%M:%S')
    except ValueError:
        return None
    return _Written(moment, digits if digits.isdecimal() else '', offset)


def _zone(offset: str) -> timezone | None:
    """Return the zone written as `+01:00` or `+0100`, or None for local time.

    Raises:
        ValueError: the offset is a day or more.
    """
    found = _OFFSET.fullmatch(offset)
    if found is None:
        return None
    hours, minutes = found.groups()
    shift = timedelta(hours=int(hours[1:]), minutes=int(minutes))
    return timezone(-shift if hours.startswith('-') else shift)
