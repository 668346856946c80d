"""Pictures of the whole rig."""

import io
from pathlib import Path

import pytest
from PIL import Image

from porotwin_core.basis.errors import InputError
from porotwin_core.rig.rig_picture import rig_picture


def written(kind: str, orientation: int) -> bytes:
    exif = Image.Exif()
    exif[0x0112] = orientation
    file = io.BytesIO()
    Image.new('RGB', (60, 40), 'red').save(file, kind, exif=exif)
    return file.getvalue()


@pytest.mark.parametrize('kind', ['JPEG', 'PNG', 'TIFF'])
@pytest.mark.parametrize('orientation', [3, 6])
def test_a_picture_that_viewers_turn_is_refused(kind: str, orientation: int) -> None:
    def read(data: bytes) -> Image.Image:
        return rig_picture(Path('sands.png'), data, 'RGB', width_m=0.6, height_m=0.4)

    assert read(written(kind, 1)).size == (60, 40)
    with pytest.raises(InputError, match=f'sands.png: EXIF orientation {orientation} is not'):
        read(written(kind, orientation))
