"""A front across a cell keeps its concentration, however bent the response is."""

from dataclasses import replace

import numpy as np
import pytest

from porotwin_core.geometry.grid import conservative_resample
from porotwin_imaging.tracer.calibration import Calibration, Response
from porotwin_imaging.tracer.front_curvature import without_curvature
from porotwin_imaging.tracer.tracer_signal import Contrast

CELLS, SAMPLES, TILES = 40, 6, 2
POINTS = np.linspace(0.0, 1.0, 41)


def response_of(bend: float, contrast: Contrast) -> np.ndarray:
    """Return the signal at `POINTS`; stock takes 0.8 of the light."""
    shape = np.expm1(-bend * POINTS) / np.expm1(-bend)
    return shape * (0.8 if contrast == 'difference' else -np.log(0.2))


def seen(truth: np.ndarray, signal: np.ndarray, contrast: Contrast) -> np.ndarray:
    """Return the concentration that cells read: light by tiles, its logarithm by cells."""
    shown = np.interp(truth, POINTS, signal)
    light = 1 - shown if contrast == 'difference' else np.exp(-shown)
    tiles = np.log(conservative_resample(light, (CELLS * TILES,) * 2))
    logs = conservative_resample(tiles, (CELLS, CELLS))
    return np.interp(1 - np.exp(logs) if contrast == 'difference' else -logs, signal, POINTS)


@pytest.mark.parametrize('contrast', ['absorbance', 'difference'])
@pytest.mark.parametrize('bend', [0.8, -0.3])
def test_a_front_keeps_its_concentration(
    calibration: Calibration, bend: float, contrast: Contrast
) -> None:
    place = (np.arange(CELLS * 12) + 0.5) / 12
    fine = np.broadcast_to(0.5 * (1 + np.tanh((place - 20.3) / 1.2)), (CELLS * 12, CELLS * 12))
    truth = conservative_resample(fine, (CELLS, CELLS))
    signal = response_of(bend, contrast)
    read = seen(fine, signal, contrast)
    curve = Response(tuple(signal), tuple(POINTS), (0.0,) * POINTS.size)
    used = replace(
        calibration, response=curve, signal=replace(calibration.signal, contrast=contrast)
    )
    found = without_curvature(read, used, SAMPLES)
    assert np.linalg.norm(found - truth) < 0.6 * np.linalg.norm(read - truth)


def test_even_parts_hidden_cells_and_small_cells_stay(calibration: Calibration) -> None:
    values = np.full((8, 8), 0.4)
    values[2:4, 3] = np.nan
    np.testing.assert_allclose(without_curvature(values, calibration, SAMPLES), values, atol=1e-6)
    assert without_curvature(values, calibration, 2) is values
