"""What the twin of the loop bench sees: photographs of the virtual rig, or noisy maps."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from porotwin_cli.running.loop_rig import Eyes, LoopSettings, map_eyes
from porotwin_cli.running.loop_scenario import LoopScenario
from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.calibration_fit import InjectionSource, fit_calibration
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_rig.camera import ASPECT, camera_before
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.plume_model import plume_model

CALIBRATION_S = 2400.0
CALIBRATION_PHOTOS = 8
"""Length [s] and number of photographs of the known injection that calibrates the camera."""


@dataclass(frozen=True)
class BenchSettings(LoopSettings):
    """How exactly the bench looks.

    Attributes:
        photographs: whether maps are made from rendered photographs, or from the tracer with the
            noise of an image analysis, which is faster.
        photo_width: width of the photographs [px].
    """

    photographs: bool = True
    photo_width: int = 800

    @classmethod
    def quick(cls) -> 'BenchSettings':
        """Return settings with maps instead of photographs, on coarse grids for all.

        A run takes a tenth of the time. Twin and virtual rig smear fronts more.
        """
        return cls(photographs=False, cell_m=0.015, rig_cell_m=0.008)


def make_eyes(scenario: LoopScenario, settings: BenchSettings) -> Eyes:
    """Return the eyes of the twin in a scenario.

    Photographs need a calibrated camera: it photographs a known injection into the same rig first.
    If the effects of the rig forbid a calibration, the camera was calibrated before they came.

    Raises:
        InputError: the photographs of the known injection do not suffice for a calibration.
    """
    grid = settings.grid(scenario)
    if not settings.photographs:
        return map_eyes(scenario, settings)
    width = settings.photo_width
    camera = camera_before(scenario.rig, width, round(width * ASPECT))
    photographer = Photographer(scenario.rig, camera=camera, seed=scenario.seed)
    try:
        baseline = _calibrated_baseline(scenario, settings, photographer)
    except InputError:
        healthy = replace(scenario, effects=())
        baseline = _calibrated_baseline(healthy, settings, photographer)

    def eyes(asset: VirtualRig) -> Observation:
        found = concentration_map(_photograph(photographer, asset, grid), baseline)
        maps = (found.values, found.deviation, found.systematic)
        return Observation(asset.time, *(np.asarray(one, dtype=float) for one in maps))

    return eyes


def _photograph(photographer: Photographer, asset: VirtualRig, grid: Grid) -> bytes:
    signal = signal_seen(asset, grid.refined(2), time=asset.time)
    return photographer.photograph(signal, time=asset.time)


def _calibrated_baseline(
    scenario: LoopScenario, settings: BenchSettings, photographer: Photographer
) -> Baseline:
    grid = settings.grid(scenario)
    asset = VirtualRig(scenario.rig, effects=scenario.effects, cell=settings.rig_cell_m)
    safe = Limits.of(scenario.rig).safe()
    asset.set_rates(safe)
    photographs = []
    for _ in range(CALIBRATION_PHOTOS):
        asset.advance(CALIBRATION_S / CALIBRATION_PHOTOS)
        photographs.append((asset.time, _photograph(photographer, asset, grid)))
    first, schedule = photographer.baseline(), Schedule.constant(safe)
    fit = fit_calibration(
        photographer.rig,
        [first],
        photographs,
        schedule=schedule,
        plumes=partial(plume_model, photographer.rig, schedule),
        source=InjectionSource('known injection'),
    )
    return make_baseline(photographer.rig, grid, [first], calibration=fit.calibration)
