"""What the true effect leaves: the cases, and their true parameters in the library."""

import numpy as np
import pytest

from lab.blind.true_effect import case_with, true_fit, variants
from porotwin_cli.running.drawn_effects import LIBRARY
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import Sample


def sample_of(case):
    """Return the sample of an empty recording of `case`."""
    grid = case.rig.default_grid(case.cell_m)
    return Sample(
        rig=case.rig,
        schedule=case.schedule,
        grid=grid,
        times=np.array([0.0, case.duration]),
        observed=np.zeros((2, *grid.shape)),
        fitted_frames=1,
        noise=Noise(0.02, 0.01, 0.01, 0.8),
        start=0.0,
        held_out_start=0.7 * case.duration,
        end=case.duration,
    )


@pytest.mark.parametrize('name', LIBRARY)
def test_every_effect_has_a_candidate_with_its_true_parameters(name):
    case = case_with(name, 0)
    effect = case.effects[0]
    assert effect.name == name
    assert effect == case_with(name, 0).effects[0] != case_with(name, 1).effects[0]
    found = variants(sample_of(case), effect)
    assert found
    for candidate in found:
        again = candidate.described(true_fit(candidate, effect))
        for parameter in candidate.parameters:
            true = effect.parameters[parameter.name]
            assert again.parameters[parameter.name] == pytest.approx(true)
