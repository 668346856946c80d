"""The exposure time that a camera wrote into a photograph.

It is EXIF `DateTimeOriginal` with `SubSecTimeOriginal` and, in newer
cameras, `OffsetTimeOriginal`. Without an offset the time is local time of this machine.
"""

import io
import re
import warnings
from datetime import datetime

from PIL import Image

from porotwin_core.errors import InputError

_EXIF_DIRECTORY = 0x8769
_ORIGINAL_TAG, _SUBSECOND_TAG, _OFFSET_TAG = 0x9003, 0x9291, 0x9011
_OFFSET = re.compile(r'[+-]\d{2}:\d{2}')
HEADER_BYTES = 1 << 18
"""Bytes that contain the EXIF data, which lies in the first 64 kB of a JPEG."""


def written_time(data: bytes) -> str:
    """Return the exposure time as the camera wrote it into the photograph `data`.

    The form is `2024-05-31 14:30:00.25+02:00`, without the last parts if the camera wrote none.
    Empty if it wrote no time, or if its clock was never set.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a large or damaged file; decoding judges it
            image = Image.open(io.BytesIO(data[:HEADER_BYTES]))
        with image:
            tags = image.getexif().get_ifd(_EXIF_DIRECTORY)
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return ''
    written, digits, offset = (
        str(tags.get(tag, '')).strip('\0 ') for tag in (_ORIGINAL_TAG, _SUBSECOND_TAG, _OFFSET_TAG)
    )
    try:
        moment = datetime.strptime(written, '%Y:%m:%d %H:%M:%S')
    except ValueError:
        return ''
    fraction = f'.{digits}' if digits.isdecimal() else ''
    return f'{moment:%Y-%m-%d %H:%M:%S}{fraction}{offset if _OFFSET.fullmatch(offset) else ""}'


def exif_time(data: bytes) -> float | None:
    """Return the exposure time of the photograph `data` [s since 1970, UTC], None if it has none.

    Raises:
        InputError: the camera wrote an impossible time.
    """
    written = written_time(data)
    if not written:
        return None
    try:
        return datetime.fromisoformat(written).timestamp()
    except (ValueError, OverflowError, OSError):
        raise InputError(f"EXIF time '{written}' is impossible; set the camera's clock") from None
