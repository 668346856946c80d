"""The accuracy of the maps on photographs that are rendered from known concentrations.

The virtual rig renders grains, a colour chart, tilt and bulge of the lens, drifting light, a nudged
camera, sensor noise and JPEG. Its numerics are independent of the imaging. The imaging is
calibrated on an injection and tested on other photographs. Limits: a relative L2 error of 1.5 % and
an error of mass of 1 %.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from porotwin_core.geometry.grid import conservative_resample
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_core.rig import Rig, rig_from_maps
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.calibration_fit import fit_calibration
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_rig.camera import camera_before
from porotwin_rig.render import Conditions, Photographer

WIDTH, HEIGHT = 0.934, 0.562
FINE = (562, 934)
STEADY = Conditions(light_drift=0.0, light_gradient=0.0, shake_px=0.0)
ROUGH = Conditions(light_drift=0.1, light_gradient=0.05, shift_px=(12.0, 9.0))
GRIDS = [(280, 150), (187, 112)]


def rig() -> Rig:
    """Return a rig with layers of three sands."""
    permeability = np.full((112, 187), 6.57e-10)
    height = np.arange(112) / 112
    permeability[(height > 0.35) & (height < 0.5)] = 2e-11
    permeability[height > 0.8] = 8e-11
    return rig_from_maps(
        {
            'name': 'accuracy',
            'width_m': WIDTH,
            'height_m': HEIGHT,
            'viscosity_pa_s': 1e-3,
            'density_kg_m3': 998.0,
            'wells': {'injector': {'x_m': 0.3, 'z_m': 0.28}},
        },
        {'depth_m': 0.01, 'porosity': 0.375, 'permeability_m2': permeability},
    )


@cache
def plume(growth: float) -> np.ndarray:
    """Return a true map: a plume of stock with a hole after growth 1, and a fainter plume."""
    z, x = np.mgrid[0 : HEIGHT : FINE[0] * 1j, 0 : WIDTH : FINE[1] * 1j]

    def disc(at_x: float, at_z: float, radius: float, rim: float) -> np.ndarray:
        return 0.5 * (1 - np.tanh((np.hypot(x - at_x, z - at_z) - radius) / rim))

    whole = disc(0.3, 0.28, 0.06 + 0.05 * growth, 0.008)
    if growth > 1:
        whole = whole * (1 - 0.8 * disc(0.3, 0.28, 0.03 * growth, 0.01))
    both = np.maximum(whole, 0.5 * disc(0.65, 0.35, 0.03 + 0.02 * growth, 0.02))
    both.flags.writeable = False
    return both


@dataclass(frozen=True)
class Errors:
    l2: float
    mass: float


@pytest.fixture(scope='module')
def errors() -> dict[bool, dict[tuple[int, int], Errors]]:
    """Return the errors by rough conditions and grid, the worst of two photographs."""
    return {rough: _errors(ROUGH if rough else STEADY) for rough in (False, True)}


def _errors(conditions: Conditions) -> dict[tuple[int, int], Errors]:
    described = rig()
    camera = camera_before(described, 1600, 1000)
    photographer = Photographer(described, camera=camera, conditions=conditions, seed=7)
    empty = photographer.baseline()
    growths = (0.2, 0.6, 1.1, 1.6, 2.2, 3.0)
    times = [600.0 * growth for growth in growths]
    states = [
        (time, photographer.photograph(plume(growth), time=time))
        for time, growth in zip(times, growths, strict=True)
    ]
    calibration = fit_calibration(
        photographer.rig, [empty], states, schedule=_pump_log(times, growths)
    ).calibration
    tested = {
        growth: photographer.photograph(plume(growth), time=600.0 * growth + 7.0)
        for growth in (0.9, 2.6)
    }
    found = {}
    for grid in GRIDS:
        baseline = make_baseline(
            photographer.rig, described.grid(*grid), [empty], calibration=calibration
        )
        found[grid] = _worst(baseline, tested)
    return found


def _pump_log(times: list[float], growths: tuple[float, ...]) -> Schedule:
    """Return rates of stock that inject the mass of the plumes."""
    volumes = [0.375 * 0.01 * WIDTH * HEIGHT * float(plume(growth).mean()) for growth in growths]
    starts, before = [0.0, *times[:-1]], [0.0, *volumes[:-1]]
    return Schedule(
        tuple(
            ScheduleRow(start, 'injector', WellRate((after - earlier) / (end - start), 1.0))
            for start, end, earlier, after in zip(starts, times, before, volumes, strict=True)
        )
    )


def _worst(baseline: Baseline, photographs: dict[float, bytes]) -> Errors:
    """Return the largest errors over photographs by the growth of their plume."""
    l2, mass = 0.0, 0.0
    for growth, data in photographs.items():
        truth = conservative_resample(plume(growth), baseline.grid.shape)
        values = concentration_map(data, baseline).values
        assert np.isfinite(values).all()
        l2 = max(l2, float(np.linalg.norm(values - truth) / np.linalg.norm(truth)))
        mass = max(mass, abs(float(values.mean() / truth.mean()) - 1))
    return Errors(l2, mass)


@pytest.mark.slow
@pytest.mark.parametrize('grid', GRIDS, ids=lambda grid: f'{grid[0]}x{grid[1]}')
@pytest.mark.parametrize('rough', [False, True], ids=['steady', 'drift and shift'])
def test_maps_and_mass_are_accurate(errors, grid, rough) -> None:
    found = errors[rough][grid]
    assert found.l2 < 0.015
    assert found.mass < 0.01


@pytest.mark.slow
def test_drifting_light_and_a_nudged_camera_hardly_add_errors(errors) -> None:
    for grid in GRIDS:
        steady, rough = errors[False][grid], errors[True][grid]
        assert abs(rough.l2 - steady.l2) < 0.005
