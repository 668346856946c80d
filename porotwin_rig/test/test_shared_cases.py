"""The virtual rig against recordings of yet another simulator, effects included."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from porotwin_core.rig import EffectDescription
from porotwin_recording.experiment.experiment_folder import read_folder
from porotwin_rig.made_experiment import signals
from porotwin_rig.virtual_rig import VirtualRig

CASES = Path(__file__).resolve().parents[2].parent / 'shared' / 'cases'

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CASES.is_dir(), reason=f'no shared cases at {CASES}'),
]


def test_recording_is_matched_down_to_its_noise() -> None:
    """The noise floor is stated over the last 30 %; a sharp model reaches the limit.

    The picture of this case is moved, so that flow, transport and camera all must be right.
    """
    folder = CASES / 'case_004'
    truth = yaml.safe_load((folder / 'truth.yaml').read_text())
    recorded = read_folder(folder)
    assert recorded.maps is not None
    assert recorded.commanded is not None
    effects = [
        EffectDescription(name=effect['name'], parameters=effect['parameters'])
        for effect in truth['effects']
    ]
    asset = VirtualRig(recorded.rig, effects=effects, cell=0.0042)  # four times as fast as usual
    times = recorded.maps.times
    error = size = 0.0
    for (time, signal), seen in zip(
        signals(asset, recorded.commanded, times=times, grid=recorded.maps.grid),
        recorded.maps,
        strict=True,
    ):
        if time < 0.7 * times[-1]:
            continue
        known = np.isfinite(seen)
        error += float(((signal - seen)[known] ** 2).sum())
        size += float((seen[known] ** 2).sum())
    assert np.sqrt(error / size) < 1.1 * truth['figures']['noise_floor']
