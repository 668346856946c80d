"""The photograph under the gap."""

import io

import numpy as np
import pytest
from diagnosis_results import no_gap, on_rig
from matplotlib.image import imsave
from PIL import Image

from porotwin_core.rig import Camera
from porotwin_diagnosis.report.page import caption
from porotwin_diagnosis.report.photograph_figure import photograph, pixels_of
from porotwin_recording.tables.photos import Photo

CORNERS = ((12.0, 9.0), (15.0, 80.0), (150.0, 84.0), (148.0, 7.0))
"""Upper left, lower left, lower right and upper right corner of the rig [px]."""


def jpeg() -> bytes:
    """Return a black photograph of 160 x 90 px."""
    buffer = io.BytesIO()
    imsave(buffer, np.zeros((90, 160, 3), dtype=np.uint8), format='jpg')
    return buffer.getvalue()


PHOTO = Photo(3600.0, 'state', 'a.jpg', jpeg)


def with_camera(result):
    camera = Camera(corners_px=CORNERS)
    return on_rig(result, result.recordings[0].rig.model_copy(update={'camera': camera}))


def test_the_corners_of_the_rig_lie_on_their_pixels(denser):
    seen = with_camera(denser).recordings[0].rig
    x = np.array([0.0, 0.0, seen.width_m, seen.width_m])
    z = np.array([seen.height_m, 0.0, 0.0, seen.height_m])
    columns, rows = pixels_of(seen, seen.camera)(x, z)
    np.testing.assert_allclose(np.stack([columns, rows], axis=1), CORNERS, atol=1e-9)


def test_the_gap_and_both_fronts_lie_upon_the_photograph(denser):
    seen = with_camera(denser)
    (axis,) = photograph(jpeg(), seen).axes
    assert len(axis.collections) == 3
    assert 'Pink: where the gap arises' in caption(seen, 'photograph', 0, photo=PHOTO)
    assert axis.get_xlim() == (-0.5, 159.5)


def test_without_a_gap_there_is_one_front(denser):
    none = no_gap(with_camera(denser))
    (axis,) = photograph(jpeg(), none).axes
    assert len(axis.collections) == 1
    assert 'Blue' not in caption(none, 'photograph', 0, photo=PHOTO)


def test_without_corners_the_photograph_is_bare(denser):
    (axis,) = photograph(jpeg(), denser).axes
    assert not axis.collections
    assert caption(denser, 'photograph', 0, photo=PHOTO) == 'The last photograph, 60 min.'


def test_a_broken_file_is_refused(denser):
    buffer = io.BytesIO()
    Image.new('RGB', (16, 9)).save(buffer, 'BMP')
    size = buffer.getvalue()[18:26]
    damaged = buffer.getvalue().replace(size, b'\xff\xff\xff\x0f' * 2)
    for content in (b'no photograph', damaged):
        with pytest.raises((OSError, ValueError, SyntaxError)):
            photograph(content, denser)
