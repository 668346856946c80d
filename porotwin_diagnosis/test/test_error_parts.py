"""The parts of the error that remains: camera, scheme, noise, and the model."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from diagnosis_examples import DENSER, sample_of

from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.data.error_parts import (
    COARSER,
    ErrorParts,
    error_parts,
    held_out_frames,
)
from porotwin_diagnosis.data.noise import Noise
from porotwin_diagnosis.data.sample import Sample, coarsened
from porotwin_diagnosis.data.shared_errors import ErrorSizes
from porotwin_diagnosis.model.forward import Forward

NOISE = 0.01
SIZES = ErrorSizes((0.05,), bend=0.02, place_m=1e-4, blur_m2=0.0)


@pytest.fixture(scope='module')
def late(quiet) -> Sample:
    """The held-out frames of a rig without a gap."""
    return held_out_frames(sample_of(quiet))


@pytest.fixture(scope='module')
def truth(late) -> tuple[FloatArray, FloatArray]:
    """The maps of the model on the cells of the recording, and on larger ones."""
    return Forward(late).maps(()), Forward(coarsened(late, COARSER)).maps(())


def _parts(
    late: Sample, true: FloatArray, truth: tuple[FloatArray, FloatArray], sizes: ErrorSizes = SIZES
) -> ErrorParts:
    """Return the parts of the model `truth` beside noisy maps of `true`."""
    noise = NOISE * np.random.default_rng(4).standard_normal(true.shape)
    seen = replace(
        late,
        observed=np.where(np.isfinite(late.observed), true + noise, np.nan),
        own_deviation=np.full(true.shape, NOISE),
        shared_errors=sizes,
        noise=Noise(0.0, NOISE, NOISE, 1.0, random=(NOISE,), systematic=(0.05,)),
    )
    found = error_parts(seen, *truth, 0.0)
    assert np.linalg.norm(astuple(found)) == pytest.approx(seen.relative_error(truth[0]))
    return found


def test_a_wrong_scale_of_the_maps_is_the_camera_s(late, truth) -> None:
    found = _parts(late, 1.05 * truth[0], truth)
    assert found.camera == pytest.approx(0.05, abs=0.01)
    assert found.rest < 0.3 * found.camera
    assert found.noise > 0.0


def test_noise_alone_is_noise(late, truth) -> None:
    found = _parts(late, truth[0], truth)
    assert found.noise == max(found.camera, found.noise, found.scheme, found.rest)
    assert found.rest < 0.3 * np.linalg.norm(astuple(found))


def test_a_wrong_model_is_what_is_left(late, truth) -> None:
    found = _parts(late, Forward(late).maps((DENSER,)), truth)
    assert found.rest > max(found.camera, found.noise)


def test_a_model_without_tracer_has_no_error_of_its_scheme(late, truth) -> None:
    found = _parts(late, truth[0], tuple(map(np.zeros_like, truth)))
    assert found.scheme == 0.0
    assert np.linalg.norm(astuple(found)) == pytest.approx(1.0)


def test_a_model_on_large_cells_shows_its_scheme(late, truth) -> None:
    finer = Forward(late, refinement=4).maps(())
    found = _parts(late, finer, truth)
    assert found.scheme > found.rest


def test_the_camera_s_part_is_no_larger_than_the_errors_that_the_calibration_states(
    late, truth
) -> None:
    """They take away more of a wrong front than their own size."""
    moved = np.roll(truth[0], 2, axis=2)
    found = _parts(late, moved, truth, replace(SIZES, place_m=0.1 * late.grid.dx))
    assert found.camera < 0.5 * found.rest
