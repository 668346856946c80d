"""The photograph under the gap."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imsave
from PIL import Image

from porotwin_core.rig import Camera
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.report.photograph_figure import caption, photograph, pixels_of

CORNERS = ((12.0, 9.0), (15.0, 80.0), (150.0, 84.0), (148.0, 7.0))
"""Upper left, lower left, lower right and upper right corner of the rig [px]."""


def jpeg() -> bytes:
    """Return a black photograph of 160 x 90 px."""
    buffer = io.BytesIO()
    imsave(buffer, np.zeros((90, 160, 3), dtype=np.uint8), format='jpg')
    return buffer.getvalue()


def with_camera(result):
    recording = result.recordings[0]
    rig = recording.rig.model_copy(update={'camera': Camera(corners_px=CORNERS)})
    return replace(result, recordings=(replace(recording, rig=rig),))


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
    assert 'Pink: where the gap arises' in caption(60.0, seen)
    assert axis.get_xlim() == (-0.5, 159.5)


def test_without_a_gap_there_is_one_front(denser):
    seen = with_camera(denser)
    none = replace(seen, verdict=Verdict('none', 0.9, seen.evidence.findings.null, (), (), {}))
    (axis,) = photograph(jpeg(), none).axes
    assert len(axis.collections) == 1
    assert 'Blue' not in caption(60.0, none)


def test_without_corners_the_photograph_is_bare(denser):
    (axis,) = photograph(jpeg(), denser).axes
    assert not axis.collections
    assert caption(3600.0, denser) == 'The last photograph, 60 min.'


def test_a_broken_file_is_refused(denser):
    buffer = io.BytesIO()
    Image.new('RGB', (16, 9)).save(buffer, 'BMP')
    size = buffer.getvalue()[18:26]
    damaged = buffer.getvalue().replace(size, b'\xff\xff\xff\x0f' * 2)
    for content in (b'no photograph', damaged):
        with pytest.raises((OSError, ValueError, SyntaxError)):
            photograph(content, denser)
