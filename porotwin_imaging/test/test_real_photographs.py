"""Maps of real photographs of the large FluidFlower show the tracer that an expert finds there."""

import re
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from lab.photographs.laser_grid_check import check_laser_grid
from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig, load_rig
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.calibration_fit import fit_calibration
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.phases.phase_colours import DISSOLVED, GAS, UNKNOWN, WATER
from porotwin_imaging.phases.phase_study import PhaseStudy
from porotwin_imaging.photo_to_map import ConcentrationMap, concentration_map

PUBLISHED = {
    'vertical_bulge': -2.73e-8,
    'vertical_bulge_offset': -31,
    'horizontal_stretch': -1.16e-8,
    'horizontal_stretch_offset': -114,
    'vertical_stretch': 7.60e-9,
    'vertical_stretch_offset': 168,
}
"""Curvature published for this camera position (README of the photographs)."""

NX, NZ = 280, 150


@pytest.fixture(scope='module')
def rig(tracer_photographs) -> Rig:
    plain = load_rig(tracer_photographs)
    camera = plain.camera.model_copy(update={'curvature': PUBLISHED})
    return plain.model_copy(update={'camera': camera})


@pytest.fixture(scope='module')
def maps(rig, tracer_photographs) -> dict[int, ConcentrationMap]:
    photos = [(tracer_photographs / f'tracer_{n}.jpg').read_bytes() for n in range(4)]
    states = [(float(n), photos[n]) for n in (1, 2, 3)]
    calibration = fit_calibration(rig, photos[:1], states).calibration
    baseline = make_baseline(rig, rig.grid(NX, NZ), photos[:1], calibration=calibration)
    return {n: concentration_map(photos[n], baseline) for n in range(4)}


def at(found: ConcentrationMap, x: float, z: float, reach: int = 2) -> float:
    """Return the mean concentration around a point [m]; NaN if little is visible."""
    j, i = int(x / 2.8 * NX), int(z / 1.5 * NZ)
    around = found.values[i - reach : i + reach + 1, j - reach : j + reach + 1]
    return float(np.nanmean(around)) if np.isfinite(around).mean() > 0.3 else float('nan')


def outside(found: ConcentrationMap, x: tuple[float, float], z: tuple[float, float]) -> float:
    """Return the largest concentration outside a box [m]."""
    values = np.nan_to_num(found.values.copy())
    columns = [int(edge / 2.8 * NX) for edge in x]
    rows = [int(edge / 1.5 * NZ) for edge in z]
    values[rows[0] : rows[1], columns[0] : columns[1]] = 0
    return float(values.max())


def test_the_baseline_shows_no_tracer(maps) -> None:
    assert np.nanmax(maps[0].values) < 0.01


def test_the_first_plume_surrounds_the_upper_well(maps) -> None:
    assert at(maps[1], 1.7, 0.73) > 0.9
    assert outside(maps[1], (1.43, 1.95), (0.58, 0.9)) < 0.03


def test_the_second_plume_reaches_the_fault_but_not_further(maps) -> None:
    for x, z in ((1.7, 0.8), (2.0, 0.8), (1.35, 0.75), (1.2, 0.68)):
        assert at(maps[2], x, z) > 0.75
    assert outside(maps[2], (0.95, 2.25), (0.55, 1.08)) < 0.03


def test_the_ring_has_a_hole_and_the_second_plume_appears(maps) -> None:
    for x, z in ((1.75, 0.8), (1.5, 0.75), (1.9, 0.7)):
        assert at(maps[3], x, z) < 0.05
    for x, z in ((1.15, 0.9), (1.8, 1.07), (2.25, 0.8), (0.93, 0.83), (1.0, 0.65)):
        assert at(maps[3], x, z) > 0.7
    assert outside(maps[3], (0.72, 2.45), (0.52, 1.22)) < 0.03


def test_the_dark_grains_of_the_fault_are_no_tracer(maps) -> None:
    for x, z in ((1.44, 0.9), (1.41, 0.83), (1.38, 0.76), (0.5, 0.65), (0.42, 0.4)):
        assert at(maps[3], x, z) < 0.06
        assert at(maps[1], x, z) < 0.03


@pytest.mark.parametrize('number', [1, 2, 3])
def test_water_bolts_chart_and_thermocouple_are_nan(maps, number) -> None:
    values = maps[number].values
    assert np.isnan(values[int(1.33 / 1.5 * NZ) :]).all()
    middle = [(0.965, 1.1), (0.985, 0.99), (1.025, 0.88)]  # along the thermocouple
    assert all(np.isnan(values[int(z / 1.5 * NZ), int(x / 2.8 * NX)]) for x, z in middle)
    below_water = values[: int(1.2 / 1.5 * NZ), 3:-3]
    assert np.isfinite(below_water).mean() > 0.98


def test_there_is_no_jump_at_the_light_sand(maps) -> None:
    """Single cells differ by their grains; rows along the interface do not."""
    low, high = (int(z / 1.5 * NZ) for z in (1.03, 1.09))
    left, right = (int(x / 2.8 * NX) for x in (1.65, 1.86))
    inside = maps[3].values[low:high, left:right]
    assert np.abs(np.diff(inside.mean(axis=1))).max() < 0.05
    assert inside.mean(axis=1).min() > 0.85
    assert inside.min() > 0.75


@dataclass(frozen=True)
class Uncalibrated:
    """The photograph of the second plume beside a baseline without a calibration."""

    photograph: bytes
    baseline: Baseline
    before: ConcentrationMap


@pytest.fixture(scope='module')
def uncalibrated(rig, tracer_photographs) -> Uncalibrated:
    clean, plume = ((tracer_photographs / f'tracer_{n}.jpg').read_bytes() for n in (0, 3))
    baseline = make_baseline(rig, rig.grid(NX // 2, NZ // 2), [clean])
    return Uncalibrated(plume, baseline, concentration_map(plume, baseline))


@pytest.mark.parametrize('factor', [0.5, 1.5, 2.0])
def test_another_exposure_never_erases_the_plume(uncalibrated, factor) -> None:
    """Tracer is seen as before, or it is not seen and the map says so, or there is no map."""
    before = uncalibrated.before
    pixels = cv2.imdecode(np.frombuffer(uncalibrated.photograph, np.uint8), cv2.IMREAD_COLOR)
    brighter = cv2.imencode('.jpg', cv2.convertScaleAbs(pixels, alpha=factor))[1].tobytes()
    try:
        found = concentration_map(brighter, uncalibrated.baseline)
    except InputError as error:
        assert re.search('over-exposed|times the light|is brighter', str(error))
        return
    plume = before.values > 0.5
    seen = plume & np.isfinite(found.values)
    assert found.values[seen].mean() > 0.8 * before.values[seen].mean()
    assert seen.sum() > 0.95 * plume.sum() or found.suspicious


def test_the_laser_grid_is_straight_and_square(rig, tracer_photographs) -> None:
    data = (tracer_photographs / 'baseline_with_laser_grid.jpg').read_bytes()
    bent = rig.model_copy(update={'camera': rig.camera.model_copy(update={'curvature': {}})})
    before, after = (check_laser_grid(data, Geometry.of(one)) for one in (bent, rig))
    assert min(after.lines) > 10
    assert after.straightness_m < 0.0015 < 0.004 < before.straightness_m
    assert after.skew_deg < 0.05
    assert after.spacing < 0.6 * before.spacing


def test_lost_and_gained_tracer_are_two_phases(rig, maps, tracer_photographs) -> None:
    """Relative to the second photograph, the third lost its dye in places, as gas would."""
    before, after = ((tracer_photographs / f'tracer_{n}.jpg').read_bytes() for n in (2, 3))
    baseline = make_baseline(rig, rig.grid(NX, NZ), [before])
    found = PhaseStudy.of({0.0: lambda: after}, baseline, {}).phases(after)
    change, known = maps[3].values - maps[2].values, found.phase != UNKNOWN
    for phase, cells in ((GAS, change < -0.6), (DISSOLVED, change > 0.6)):
        assert (found.phase[cells & known] == phase).mean() > 0.9
    assert (found.phase[(np.abs(change) < 0.05) & known] == WATER).mean() > 0.99
