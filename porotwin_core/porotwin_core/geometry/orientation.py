"""The EXIF orientation of a picture: viewers turn it by that, and PoroTwin does not."""

import io
import warnings

from PIL import Image
from PIL.ExifTags import Base

UPRIGHT = 1


def orientation(data: bytes) -> int:
    """Return the EXIF orientation (1 to 8) of the picture in the file `data`, 1 by default."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            image = Image.open(io.BytesIO(data))
        with image:
            written = image.getexif().get(Base.Orientation, UPRIGHT)
    except Exception:  # a damaged header makes Pillow raise errors of many types
        return UPRIGHT
    return written if written in range(1, 9) else UPRIGHT
