"""The virtual rig of a scenario, with its hidden faults, and the maps that the twin sees of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from porotwin_cli.running.loop_scenario import LoopScenario, PumpFault
from porotwin_core.basis.units import ML
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.wells import WellRate, WellRates, mean_rates
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.objectives.objective_registry import make_objective
from porotwin_rig.camera_signal import signal_seen
from porotwin_rig.map_camera import MapCamera, MapNoise
from porotwin_rig.virtual_rig import VirtualRig

Eyes = Callable[[VirtualRig], Observation]
"""Returns the map that the twin sees of a rig now."""


@dataclass(frozen=True)
class LoopSettings:
    """How exactly a loop is simulated.

    Attributes:
        cell_m: width of the cells of maps and model [m].
        rig_cell_m: width of the elements of the virtual rig [m].
        preset: numerical scheme of the model.
    """

    cell_m: float = 0.01
    rig_cell_m: float = 0.004
    preset: str = 'fast'

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
        return self.time >= self._scenario.end - SAME_STAMP_S

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
        return float(trapezoid(self._volumes, np.array(self._times) / 60.0))

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


def map_eyes(scenario: LoopScenario, settings: LoopSettings) -> Eyes:
    """Return eyes that see the true maps with the noise of an image analysis."""
    grid = settings.grid(scenario)
    camera = MapCamera(grid, MapNoise.drawn(scenario.seed), seed=scenario.seed)

    def eyes(asset: VirtualRig) -> Observation:
        signal = signal_seen(asset, grid, time=asset.time)
        return Observation(asset.time, camera.map(signal, round(asset.time)))

    return eyes
