"""The baseline: it names a term of an equation, and knows no camera."""

import pytest
from diagnosis_examples import DENSER, ELEMENT_M, recorded

from lab.benches.sparse_regression import sparse_regression
from porotwin_core.rig import EffectDescription
from porotwin_recording.experiment.recording import open_recording

pytest.importorskip('pysindy')

SHIFTED = EffectDescription(
    name='registration', parameters={'dx': 0.004, 'dz': -0.003, 'rotation': 0.005, 'scale': 1.0}
)


@pytest.mark.parametrize(('effect', 'named'), [(DENSER, 'porosity'), (SHIFTED, 'dispersion')])
def test_the_baseline_names_a_lower_porosity_and_takes_a_shifted_picture_for_dispersion(
    tmp_path, effect, named
):
    recording = recorded(tmp_path / 'recording', effect, cell=2.0 * ELEMENT_M)
    assert sparse_regression(open_recording(recording)) == named
