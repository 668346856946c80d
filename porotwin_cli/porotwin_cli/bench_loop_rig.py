"""The virtual rig of a scenario, with its hidden faults, and the maps that the twin sees of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from porotwin_cli.bench_loop_scenarios import LoopScenario, PumpFault
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import Schedule, WellRate, WellRates, mean_rates
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_imaging.baseline.baseline import Baseline, make_baseline
from porotwin_imaging.calibrating.calibration_fit import fit_calibration
from porotwin_imaging.photo_to_map import concentration_map
from porotwin_rig.camera import ASPECT, camera_before
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.map_camera import MapCamera, MapNoise
from porotwin_rig.render import Photographer
from porotwin_rig.virtual_rig import VirtualRig
from porotwin_solver.model.plume_model import plume_model

CALIBRATION_S = 2400.0
CALIBRATION_PHOTOS = 8
"""Length [s] and number of photographs of the known injection that calibrates the camera."""

ROUND_OFF_S = 1e-6
"""Times that differ by less are the same [s]."""

Eyes = Callable[[VirtualRig], Observation]
"""Returns the map that the twin sees of a rig now."""


@dataclass(frozen=True)
class LoopSettings:
    """How exactly the bench looks.

    Attributes:
        photographs: whether maps are made from rendered photographs, or from the tracer with the
            noise of an image analysis, which is faster.
        photo_width: width of the photographs [px].
        cell_m: width of the cells of maps and model [m].
        rig_cell_m: width of the elements of the virtual rig [m].
        preset: numerical scheme of the model.
    """

    photographs: bool = True
    photo_width: int = 800
    cell_m: float = 0.01
    rig_cell_m: float = 0.004
    preset: str = 'fast'

    @classmethod
    def quick(cls) -> 'LoopSettings':
        """Return settings with maps instead of photographs, on coarse grids for all.

        A run takes a tenth of the time. Twin and virtual rig smear fronts more.
        """
        return cls(photographs=False, cell_m=0.015, rig_cell_m=0.008)

    def grid(self, scenario: LoopScenario) -> Grid:
        """Return the grid of maps and model."""
        return scenario.rig.default_grid(self.cell_m)


class LoopRig:
    """The rig of one run: it pumps the rates of the operator, less the faults."""

    def __init__(self, scenario: LoopScenario, settings: LoopSettings) -> None:
        """Pump the safe rates until the twin takes over."""
        self._scenario = scenario
        self._asset = VirtualRig(scenario.rig, effects=scenario.effects, cell=settings.rig_cell_m)
        self._limits = Limits.of(scenario.rig)
        self._grid = settings.grid(scenario)
        self._disallowed = make_objective(scenario.rig, self._grid).disallowed_tracer
        self.water_ml = 0.0
        """Water that the control wells have injected since the twin took over [ml]."""
        self._times: list[float] = []
        self._volumes: list[float] = []
        safe = self._limits.safe()
        if scenario.start > 0.0:
            self._pump(safe, scenario.start)
        self.water_ml = 0.0
        self._note()

    @property
    def time(self) -> float:
        """Time since the start of the experiment [s]."""
        return self._asset.time

    @property
    def is_over(self) -> bool:
        """Whether the experiment has ended."""
        return self.time >= self._scenario.end - ROUND_OFF_S

    def seen(self, eyes: Eyes) -> Observation:
        """Return the map that the twin sees now."""
        return eyes(self._asset)

    def advance(self, rates: WellRates) -> dict[str, WellRate]:
        """Pump the `rates` that are set [m^3/s] until the next photograph.

        Returns:
            The mean rates that flow meters show.
        """
        metered = self._pump(
            rates, min(self.time + self._scenario.photo_interval, self._scenario.end)
        )
        self._note()
        return metered

    @property
    def end_ml(self) -> float:
        """True tracer now where it must not be [ml]."""
        return self._volumes[-1]

    @property
    def dose_ml_min(self) -> float:
        """Integral over time of the true tracer where it must not be [ml min]."""
        return float(np.trapezoid(self._volumes, np.array(self._times) / 60.0))

    @property
    def course_ml(self) -> list[float]:
        """True tracer where it must not be at every photograph [ml]."""
        return list(self._volumes)

    def _note(self) -> None:
        self._times.append(self.time)
        self._volumes.append(ML * self._disallowed(self._asset.concentration(self._grid)))

    def _pump(self, rates: WellRates, until: float) -> dict[str, WellRate]:
        edges = {edge for fault in self._scenario.faults for edge in (fault.start, fault.end)}
        moments = [*sorted(edge for edge in edges if self.time < edge < until), until]
        periods = []
        for moment in moments:
            begin = self.time
            delivered = delivered_rates(rates, self._scenario.faults, begin)
            self._asset.set_rates(delivered)
            self._asset.advance(moment - begin)
            self.water_ml += ML * (moment - begin) * self._limits.control_rates(delivered).sum()
            periods.append((begin, moment, delivered))
        return mean_rates(periods)


def delivered_rates(
    rates: WellRates, faults: Sequence[PumpFault], time: float
) -> dict[str, WellRate]:
    """Return the delivered part of the `rates` at the pumps [m^3/s], at `time` [s]."""
    found = dict(rates)
    for fault in faults:
        if fault.start <= time < fault.end and fault.well in found:
            well = found[fault.well]
            found[fault.well] = WellRate(well.rate * fault.share, well.concentration)
    return found


def make_eyes(scenario: LoopScenario, settings: LoopSettings) -> Eyes:
    """Return the eyes of the twin in a scenario.

    Photographs need a calibrated camera: it photographs a known injection into the same rig first.
    If the effects of the rig forbid a calibration, the camera was calibrated before they came.

    Raises:
        InputError: the photographs of the known injection do not suffice for a calibration.
    """
    grid = settings.grid(scenario)
    if not settings.photographs:
        return _map_eyes(scenario, grid)
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


def _map_eyes(scenario: LoopScenario, grid: Grid) -> Eyes:
    camera = MapCamera(grid, MapNoise.drawn(scenario.seed), seed=scenario.seed)

    def eyes(asset: VirtualRig) -> Observation:
        signal = signal_seen(asset, grid, time=asset.time)
        return Observation(asset.time, camera.map(signal, round(asset.time)))

    return eyes


def _photograph(photographer: Photographer, asset: VirtualRig, grid: Grid) -> bytes:
    signal = signal_seen(asset, grid.refined(2), time=asset.time)
    return photographer.photograph(signal, time=asset.time)


def _calibrated_baseline(
    scenario: LoopScenario, settings: LoopSettings, photographer: Photographer
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
        source='known injection',
    )
    return make_baseline(photographer.rig, grid, [first], calibration=fit.calibration)
