"""Photographs as files: is the file complete, how large is it, and its pixels at a reduced scale.

Pixels keep the order of the file, and an EXIF orientation is not applied. A camera that is turned
by hand between two photographs writes another orientation, but the corners of the rig are given in
pixels of the sensor.
"""

import io
import re
import struct
import warnings
import zlib
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms
from PIL.ExifTags import IFD, Base
from PIL.ImageFile import ImageFile
from PIL.PngImagePlugin import PngImageFile
from PIL.TiffImagePlugin import TiffImageFile

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.orientation import UPRIGHT
from porotwin_imaging.numerics.robust_statistics import TOP_PERCENTILE
from porotwin_imaging.photograph.jpeg_file import JPEG_START, jpeg_fault, jpeg_pixels, jpeg_size
from porotwin_imaging.photograph.linear_light import LINEAR_LIGHT


@dataclass(frozen=True)
class DecodingSettings:
    """Which photographs are refused when they are decoded (`photo_file.py`)."""

    dark_level: int = 12
    """Grey level (0 to 255). A photograph is black if its 99.5th percentile is lower."""
    bright_level: int = 250
    """Lowest grey level (0 to 255) of over-exposed pixels."""
    most_bright: float = 0.5
    """Largest accepted share of over-exposed pixels [-]."""


DECODING = DecodingSettings()

OVER_EXPOSED = float(LINEAR_LIGHT[DECODING.bright_level])
"""Lowest linear light of over-exposed pixels and patches [-]."""


PNG_START = b'\x89PNG\r\n\x1a\n'
PNG_END = b'IEND\xaeB`\x82'
TIFF_STARTS = (b'II*\x00', b'MM\x00*')
_DECODING_FLAGS = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
_READERS: dict[bytes, type[ImageFile]] = {
    PNG_START: PngImageFile,
    **dict.fromkeys(TIFF_STARTS, TiffImageFile),
}
"""Pillow's readers of headers; `Image.open` would judge the size before it is known here."""
_PLAIN_TAGS = {Base.Orientation: UPRIGHT, Base.ExtraSamples: 1}
"""Tags of a TIFF, and the values with which OpenCV gives the levels as the file holds them."""
_ADOBE_INDEX = 'R03'
"""Word of the EXIF data for Adobe RGB."""
_SRGB = 'sRGB'
OTHER_FORMATS = {
    'HEIC': re.compile(rb'....ftyp(hei|hev|mif1|msf1)', re.DOTALL),
    'AVIF': re.compile(rb'....ftypavi', re.DOTALL),
    'a raw file of a camera': re.compile(
        rb'....ftypcrx|FUJIFILMCCD-RAW|II\*\x00....CR|IIRS|IIU\x00', re.DOTALL
    ),
    'WebP': re.compile(rb'RIFF....WEBP', re.DOTALL),
    'GIF': re.compile(rb'GIF8'),
    'BMP': re.compile(rb'BM'),
    'JPEG 2000': re.compile(rb'\x00\x00\x00\x0cjP  |\xff\x4f\xff\x51'),
    'BigTIFF': re.compile(rb'II\+\x00|MM\x00\+'),
    'PDF': re.compile(rb'%PDF'),
}
"""Beginnings of files of formats that are not read."""
_BITS = 8
"""Usual bits of a level."""
_PNG_DEPTH = 24
"""Byte of a PNG that tells its bits of a level."""
_PALETTE = (
    'has a palette of at most 256 colours, too few for concentrations; save it with 24 bits, '
    'without a palette'
)
_UNREAD_MODES = {
    'LAB': 'is a TIFF with Lab colours; save it with RGB colours',
    **dict.fromkeys(('P', 'PA', '1'), _PALETTE),
    **dict.fromkeys(('F', 'I'), 'is a TIFF with levels of 32 bits; save it with 8 or 16 bits'),
}
"""Pillow's modes of files that are not decoded, their kind, and the remedy."""
MOST_PIXELS = 175_000_000
"""Larger photographs are refused before they are decoded: a damaged or malicious header may claim
any size. The largest cameras have 150 megapixels."""
MOST_BYTES = 512_000_000
"""Larger files are refused: a TIFF of 150 megapixels has 450 MB."""
_CHECKED_EVERY = 4
"""Every fourth pixel in each direction is enough to find black and white photographs."""


@dataclass(frozen=True)
class DecodedPhoto:
    """A decoded photograph.

    Attributes:
        pixels: uint8, shape (rows, columns, 3), blue-green-red, row 0 at the top.
        width: columns of the file [px].
        height: rows of the file [px].
        reduction: 1, 2, 4 or 8, the ratio of file pixels to decoded pixels. A point `p` of the file
            lies at `(p + 0.5) / reduction - 0.5` in `pixels`.
    """

    pixels: NDArray[np.uint8]
    width: int
    height: int
    reduction: int


def _pixels(data: bytes, reduction: int = 1) -> NDArray[np.uint8] | None:
    """Return decoded pixels, or None if OpenCV cannot decode the file.

    Raises:
        InputError: a JPEG is damaged.
    """
    if data.startswith(JPEG_START):
        return jpeg_pixels(data, reduction)
    if data.startswith(TIFF_STARTS):
        data = _with_plain_tags(data)
    if data.startswith(PNG_START) and _is_damaged_png(data):  # the decoder would print a line
        return None
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), _DECODING_FLAGS)
    except cv2.error:  # a damaged header may claim a size that OpenCV refuses
        return None
    if pixels is None:
        return None
    return np.asarray(_reduced(np.asarray(pixels), reduction), np.uint8)


def _is_damaged_png(data: bytes) -> bool:
    """Return whether a part of a PNG has another checksum than the file says."""
    place = len(PNG_START)
    while place + 12 <= len(data):
        (size,) = struct.unpack_from('>I', data, place)
        part, end = memoryview(data)[place + 4 : place + 8 + size], place + 12 + size
        if end > len(data) or struct.unpack_from('>I', data, end - 4)[0] != zlib.crc32(part):
            return True
        if part[:4] == b'IEND':  # cameras write more behind it
            return False
        place = end
    return True


def _reduced(pixels: NDArray[Any], reduction: int) -> NDArray[Any]:
    """Return the means of blocks of `reduction` x `reduction` pixels, as in a reduced JPEG.

    OpenCV's own reduction of a PNG or TIFF takes the middle of each block only, with more noise. It
    also leaves out the last block if that is not whole, and stretches the others.
    """
    if reduction == 1:
        return pixels
    rows, columns = pixels.shape[:2]
    whole = cv2.copyMakeBorder(
        pixels, 0, -rows % reduction, 0, -columns % reduction, cv2.BORDER_REPLICATE
    )
    size = (whole.shape[1] // reduction, whole.shape[0] // reduction)
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))


def _with_plain_tags(tiff: bytes) -> bytes:
    """Return the TIFF as upright, and with transparency that is in its colours already.

    OpenCV rotates TIFFs despite the flag, and darkens the colours by the transparency.
    """
    order = '<' if tiff.startswith(b'II') else '>'
    try:
        (directory,) = struct.unpack_from(order + 'I', tiff, 4)
        (count,) = struct.unpack_from(order + 'H', tiff, directory)
        entries = range(directory + 2, directory + 2 + 12 * count, 12)
        tags = {struct.unpack_from(order + 'H', tiff, entry)[0]: entry for entry in entries}
    except struct.error:  # the file is damaged; the decoder reports it
        return tiff
    for tag, value in _PLAIN_TAGS.items():
        if tag in tags:
            place = tags[tag] + 8
            tiff = tiff[:place] + struct.pack(order + 'HH', value, 0) + tiff[place + 4 :]
    return tiff


def colour_profile(data: bytes) -> str:
    """Return the name of the colour space that the file `data` declares, 'sRGB' by default.

    It stands in an ICC profile, or for Adobe RGB in the EXIF data alone.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            image = Image.open(io.BytesIO(data))
        with image:
            profile = image.info.get('icc_profile')
            if profile:
                opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
                name = ImageCms.getProfileDescription(opened).strip()
                return _SRGB if _SRGB.lower() in name.lower() else name
            if image.getexif().get_ifd(IFD.Interop).get(1) == _ADOBE_INDEX:
                return 'Adobe RGB'
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return _SRGB
    return _SRGB


def is_photograph(data: bytes) -> bool:
    """Return whether the file `data` begins as a JPEG, PNG or TIFF."""
    return data.startswith((JPEG_START, PNG_START, *TIFF_STARTS))


def is_complete(data: bytes) -> bool:
    """Return whether the file `data` ends as its format requires."""
    if data.startswith(JPEG_START):
        return not jpeg_fault(data)
    if data.startswith(PNG_START):
        return data.endswith(PNG_END)
    if data.startswith(TIFF_STARTS):
        size = _header_size(data)
        if _unread(data):
            return True
        return size is not None and size[0] * size[1] <= MOST_PIXELS and _pixels(data) is not None
    return False


def _header_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) from the header of a file; None if broken, or a camera's raw file."""
    if data.startswith(JPEG_START):
        return jpeg_size(data)
    kind = next((kind for start, kind in _READERS.items() if data.startswith(start)), None)
    if kind is None:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of odd metadata
            image = kind(io.BytesIO(data))
        with image:
            tags = getattr(image, 'tag_v2', None)
            if tags is None:
                return image.size
            # a raw file of a camera is a TIFF that begins with a preview, of subfile type 1
            if tags.get(Base.NewSubfileType) == 1 or Base.DNGVersion in tags:
                return None
            # `size` would be turned by the orientation
            return int(tags[Base.ImageWidth]), int(tags[Base.ImageLength])
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return None


def photo_size(data: bytes) -> tuple[int, int]:
    """Return (width, height) [px] of the photograph `data`, read from the header only.

    Raises:
        InputError: the file is no JPEG, PNG or TIFF, its header is broken, or it claims too many
            pixels.
    """
    found = _header_size(data)
    for name, start in OTHER_FORMATS.items():
        if start.match(data[:32]):
            raise InputError(f'photograph is {name}; set the camera to JPEG, or convert it to TIFF')
    if found is None and data.startswith(TIFF_STARTS):
        raise InputError(
            'photograph is a TIFF that cannot be read: damaged, with float levels, or the raw file '
            'of a camera; save it with 8 or 16 bits, or set the camera to JPEG'
        )
    if found is None or min(found) < 1:
        raise InputError(
            f'photograph of {len(data)} bytes: not a JPEG, PNG or TIFF; send it again, '
            'or set the camera to JPEG'
        )
    if found[0] * found[1] > MOST_PIXELS:
        raise InputError(
            f'photograph claims {found[0]} x {found[1]} px, more than any camera has; send it again'
        )
    return found


def decode(data: bytes, reduction: int = 1) -> DecodedPhoto:
    """Return the photograph `data`, decoded `reduction` (1, 2, 4 or 8) times coarser.

    A JPEG is decoded at the reduced scale directly, at a fraction of the cost of a full decode.

    Raises:
        InputError: the file is truncated or broken, it has a palette of few colours or Lab colours,
            or the photograph is black or over-exposed.
    """
    width, height = photo_size(data)
    if unread := _unread(data):
        raise InputError(f'photograph {unread}')
    if not is_complete(data):
        fault = (
            data.startswith(JPEG_START) and jpeg_fault(data)
        ) or 'is truncated: its end is missing'
        raise InputError(f'photograph of {len(data)} bytes {fault}; send it again')
    pixels = _pixels(data, reduction)
    if pixels is None:
        raise InputError(f'photograph of {len(data)} bytes is broken; send it again')
    _refuse_without_picture(pixels, deep=_bits(data) > _BITS)
    return DecodedPhoto(pixels, width, height, reduction)


def _unread(data: bytes) -> str:
    """Return why a whole file of its kind is not decoded, and the remedy; empty if it is."""
    mode = _mode(data)
    deep_png = mode == 'I' and data.startswith(PNG_START)
    return '' if deep_png else _UNREAD_MODES.get(mode, '')


def _mode(data: bytes) -> str:
    """Return Pillow's mode of a PNG or TIFF, such as 'RGB', or 'P' for numbers of colours.

    It is empty for a JPEG and a damaged file.
    """
    if not data.startswith((PNG_START, *TIFF_STARTS)):
        return ''
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            image = Image.open(io.BytesIO(data))
        with image:
            return image.mode
    except Exception:  # a damaged header; the decoder reports it
        return ''


def _bits(data: bytes) -> int:
    """Return the bits of a level in the file `data`: 8, or 16 for PNG and TIFF of that depth."""
    if data.startswith(PNG_START) and len(data) > _PNG_DEPTH:
        return data[_PNG_DEPTH]
    if data.startswith(TIFF_STARTS):
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            image = Image.open(io.BytesIO(data))
        with image:
            return int(image.tag_v2.get(Base.BitsPerSample, (_BITS,))[0])  # type: ignore[attr-defined]
    return _BITS


def _refuse_without_picture(pixels: NDArray[np.uint8], *, deep: bool) -> None:
    """Raise InputError if the photograph as a whole is black or over-exposed.

    `deep` tells that the file has more than 8 bits, which may not be used in full.
    """
    green = pixels[::_CHECKED_EVERY, ::_CHECKED_EVERY, 1]
    brightest = float(np.percentile(green, TOP_PERCENTILE))
    if brightest < DECODING.dark_level:
        raise InputError(
            f'photograph is black: 99.5 % of it at grey level {brightest:.0f} of 255 or '
            'below; check lamp, lens cap and exposure'
            + (', and that the levels of the file use all of its 16 bits' if deep else '')
        )
    bright = float(np.mean(green >= DECODING.bright_level))
    if bright > DECODING.most_bright:
        raise InputError(
            f'photograph is over-exposed: {100 * bright:.0f} % of it at full white; '
            'shorten the exposure'
        )
