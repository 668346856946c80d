"""The bend of the response and the blur of the camera from fronts of round plumes."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erfc

from porotwin_imaging.calibrating.front_response import FrontPhotographs, fit_fronts
from porotwin_imaging.tracer.response_curve import concentration_of
from porotwin_imaging.tracer.tracer_signal import Contrast

Array = NDArray[Any]

CELLS, POINTS = (60, 60), 4
RADII = (9.0, 13.0, 18.0, 22.0)
"""Radii of the plumes [cells]."""
CELL_M = 0.007
STOCK = 0.8
"""Signal of tracer stock [-]."""


def plume(radius: float, dispersivity_m: float) -> Array:
    """Return a round plume with a front that widens on its way, on the fine grid."""
    rows, columns = (np.indices((CELLS[0] * POINTS, CELLS[1] * POINTS)) + 0.5) / POINTS
    distance = np.hypot(rows - 0.5 * CELLS[0], columns - 0.5 * CELLS[1])
    width = np.sqrt(0.5**2 + 2 / 3 * 2 * radius * dispersivity_m / CELL_M)
    return 0.5 * erfc((distance - radius) / (np.sqrt(2) * width))


def model(factor: float, dispersivity_m: float) -> list[Array]:
    return [plume(radius * np.sqrt(factor), dispersivity_m) for radius in RADII]


def photographs(
    bend: float,
    *,
    dispersivity_m: float = 0.0,
    factor: float = 1.0,
    contrast: Contrast = 'absorbance',
) -> FrontPhotographs:
    """Return photographs with a blur of 1 px before and after the response."""
    signals = np.linspace(0, 1, 1001)
    taken = []
    for true in model(factor, dispersivity_m):
        blurred = cv2.GaussianBlur(true, (0, 0), 1.0)
        signal = np.interp(blurred, concentration_of(signals, bend), signals)
        kept = np.exp(-STOCK * signal) if contrast == 'absorbance' else 1 - STOCK * signal
        light = cv2.GaussianBlur(kept, (0, 0), 1.0)
        logs = cv2.resize(np.log(light), CELLS, interpolation=cv2.INTER_AREA)
        cells = -logs if contrast == 'absorbance' else 1 - np.exp(logs)
        noise = np.random.default_rng(3).normal(0.0, 0.01, CELLS)
        taken.append(cells / STOCK + noise)
    return FrontPhotographs(taken, np.ones(CELLS), (0, 1, 2, 3), contrast, STOCK, POINTS, POINTS)


@pytest.mark.parametrize('contrast', ['absorbance', 'difference'])
@pytest.mark.parametrize(
    ('bend', 'dispersivity_m', 'factor'), [(-0.1, 0.0, 1.0), (0.06, 0.0, 0.92), (-0.04, 1e-3, 1.0)]
)
def test_fronts_tell_bend_and_blur_for_any_sand(bend, dispersivity_m, factor, contrast) -> None:
    seen = photographs(bend, dispersivity_m=dispersivity_m, factor=factor, contrast=contrast)
    found = fit_fronts(seen, model, factor)
    assert found is not None
    assert abs(found.bend - bend) < 0.02
    assert 0.015 <= found.deviation < 0.04
    assert found.blur_px == pytest.approx(np.sqrt(2), abs=0.5)  # the fine model interpolates little


def test_a_late_clock_leaves_the_fronts_less_sure_and_does_not_bend_them() -> None:
    def late(factor: float, dispersivity_m: float) -> list[Array]:
        areas = [radius**2 - 0.06 * RADII[-1] ** 2 for radius in RADII]
        return [plume(np.sqrt(factor * area), dispersivity_m) for area in areas]

    found = fit_fronts(photographs(-0.1), late, 1.0)
    assert found is not None
    assert abs(found.bend + 0.1) < 2 * found.deviation
    assert found.deviation > 0.03


def test_fronts_that_no_model_has_are_no_evidence() -> None:
    assert fit_fronts(photographs(0.0, dispersivity_m=0.02), model, 1.0) is None
    empty = replace(photographs(0.0), pore_volume=np.zeros(CELLS))
    assert fit_fronts(empty, model, 1.0) is None
    assert fit_fronts(replace(empty, chosen=(0, 1)), model, 1.0) is None
