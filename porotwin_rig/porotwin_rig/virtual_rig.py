"""The virtual rig: an independent simulator in place of the physical rig."""

import itertools
import math
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import ROUND_OFF
from porotwin_core.geometry.grid import Grid
from porotwin_core.rates.water_levels import WaterLevels
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import EffectDescription, Rig
from porotwin_rig.effects import EffectSet
from porotwin_rig.mesh import Mesh
from porotwin_rig.pumps import Pumps, RunningPumps, balanced
from porotwin_rig.tracer import TracerBalance
from porotwin_rig.tracer_transport import TracerTransport
from porotwin_rig.true_rig import TrueRig
from porotwin_rig.water_flow import WaterFlow

FloatArray = NDArray[np.floating]


class VirtualRig:
    """A sand-filled tank with wells, simulated by numerics of its own.

    The class holds the time, the tracer and its balance, and advances them. The pumps are in
    `pumps`, the flow in `water_flow` (box method with analytic wells), the transport in
    `tracer_transport` (characteristics, corrected to conserve mass), the true properties in
    `true_rig`, the camera in `camera_signal` and `render`.

    Args:
        rig: the nominal rig. Its own `effects` are ignored: they are nominal, not true.
        effects: true effects of the rig and its camera, not part of the description.
        pumps: how the pumps follow their commands; exactly by default.
        cell: approximate size of an element [m]; by default 2.1 mm on the small rig.

    Attributes:
        rig: the nominal rig.
        effects: the true effects, checked.
        mesh: the mesh of the simulation.
        time: time since the start [s].
        balance: volumes of tracer injected, removed, decayed and corrected.

    Raises:
        InputError: an effect, a parameter or a well is not known, a value is impossible, or a
            source or sink lies outside the rig.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        effects: Iterable[EffectDescription] = (),
        pumps: Pumps | None = None,
        cell: float | None = None,
    ) -> None:
        self.rig = rig
        self.effects = EffectSet.checked(effects, rig)
        self.mesh = Mesh.over(rig, cell=cell)
        self.time = 0.0
        self._levels = WaterLevels.of(rig)
        self.balance = TracerBalance()
        self._true_rig = self.effects.applied(TrueRig.nominal(rig, self.mesh))
        self._pumps = RunningPumps(rig, pumps or Pumps(), self.effects)
        self._water = WaterFlow(self._true_rig)
        self._transport = TracerTransport(self._true_rig, self.effects)
        self._tracer = self._transport.empty()
        self._visible = self._transport.dissolved(self._tracer)

    def set_rates(self, rates: WellRates) -> None:
        """Command `rates` from now on; wells that are not named stop. Levels follow `rig.yaml`.

        Raises:
            InputError: a well is not known.
        """
        self._pumps.command(
            {name: rate for name, rate in rates.items() if name not in self.rig.levels}
        )

    def measured_rates(self) -> dict[str, WellRate]:
        """Return the metered rates of the last `advance`."""
        return dict(self._pumps.measured)

    @property
    def clock_offset(self) -> float:
        """Time of the rig minus the stamp of its photographs [s]."""
        return self._true_rig.clock_offset

    def advance(
        self, duration: float, passed: Callable[[float], None] = lambda _time: None
    ) -> None:
        """Advance by `duration` [s] with the rates that were set.

        `passed` is called with the time [s] after every step: some effects take thousands of them.

        Raises:
            InputError: the duration is negative.
        """
        if not duration >= 0.0:
            raise InputError(f'advance by {duration} s: give a duration of zero or more')
        self._pumps.start()
        edges = [self.time, *self._levels.moments(self.time, self.time + duration)]
        spans = [later - time for time, later in itertools.pairwise(edges)]
        for span in [*spans, duration - sum(spans)]:
            longest = self.effects.longest_step
            steps = max(1, math.ceil(span / longest - ROUND_OFF)) if span > 0.0 else 0
            for _ in range(steps):
                self._step(span / steps)
                passed(self.time)

    def concentration(self, grid: Grid) -> FloatArray:
        """Return the visible tracer on `grid`, (nz, nx).

        The mean concentration of all water in the pores of each cell, mobile or not; sorbed tracer
        is invisible. The sum of concentration times pore volume is the dissolved tracer of the rig.
        """
        return self.mesh.to_grid(self._visible, self._true_rig.pore_depth, grid)

    def visible(self) -> FloatArray:
        """Return the visible concentration [-] at the vertices of the mesh, (nz + 1, nx + 1)."""
        return self._visible

    def total_mass(self) -> float:
        """Return the volume of stock [m^3] in the rig in any form."""
        return self._transport.total_mass(self._tracer)

    def _step(self, duration: float) -> None:
        self._tracer, self.balance = self._transport.step(
            self._tracer,
            self.balance,
            water=self._water,
            rates=self._true_rates(self.time, self.time + duration),
            time=self.time,
            duration=duration,
        )
        self._visible = self._seen(duration)
        self.time += duration

    def _true_rates(self, start: float, end: float) -> dict[str, WellRate]:
        """Return the true mean rates in [start, end] [s] of all sources and sinks."""
        rates = {**self._pumps.true_rates(start, end), **self._true_rig.constant_rates}
        return rates if self._water.has_open_side else balanced(rates)

    def _seen(self, duration: float) -> FloatArray:
        """Return the visible tracer `duration` [s] after the last step."""
        dissolved = visible = self._transport.dissolved(self._tracer)
        for effect, values in self.effects:
            if effect.on_visible is not None:
                visible = effect.on_visible(self._visible, dissolved, values, duration)
        return visible
