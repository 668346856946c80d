"""The EXIF orientation of a picture."""

import io

from PIL import Image

from porotwin_core.geometry.orientation import orientation


def test_without_a_readable_orientation_a_picture_is_upright() -> None:
    file = io.BytesIO()
    Image.new('RGB', (6, 4)).save(file, 'JPEG')
    assert orientation(file.getvalue()) == 1
    assert orientation(b'hello') == 1
