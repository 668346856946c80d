"""Do maps and pumps agree, photograph by photograph? It asks the checks of a recording.

A photograph of another rig, a damaged picture, or a baseline with tracer in it passes all checks of
the light. It does not pass a balance: tracer appears or vanishes that no pump moved. Tracer in the
baseline also makes the wells pale that inject it.
"""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from porotwin_checks.checks.tracer_amount import amount_remark
from porotwin_checks.checks.tracer_at_wells import pale_well
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.rate_periods import RatePeriod, different_wells
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import Rig
from porotwin_solver.effects import tracer_storage

MAPS_IN_A_ROW = 3
"""Pale maps in a row that are told; a tube or a cover may hide the tracer in one."""

MOST_CHANGES = 1000
"""Changes of rates that are remembered: some hours of metered pumps fill a well many times."""


class TracerWatch:
    """Remembers what the pumps have injected, and compares it with each map.

    Args:
        rig: the rig.
        grid: of the maps (nz, nx).
    """

    def __init__(self, rig: Rig, grid: Grid) -> None:
        """Begin without any injection."""
        self._grid = grid
        self._changes: deque[tuple[float, WellRates]] = deque(maxlen=MOST_CHANGES)
        self.forget()
        self.change_rig(rig)

    def change_rig(self, rig: Rig) -> None:
        """Weigh tracer with the effects of `rig` from the next state on."""
        self._rig = rig
        self._storage = tracer_storage(rig, self._grid)
        self.forget_amount()

    def forget(self) -> None:
        """Forget all injections: nobody knows what the wells and the rig held in between."""
        self._changes.clear()
        self._pale = 0
        self.forget_amount()

    def forget_amount(self) -> None:
        """Count the tracer in the rig anew from the next state."""
        self._pumped = math.nan

    def at_wells(
        self, observed: FloatArray, time: float, periods: Sequence[RatePeriod]
    ) -> Remark | None:
        """Return the remark about a well that stays pale; None without one.

        Args:
            observed: concentration in the photograph [-], (nz, nx); NaN where nothing was seen.
            time: time of the photograph [s].
            periods: the rates since the photograph before.
        """
        for period in periods:
            if not self._changes or different_wells(self._changes[-1][1], period.rates):
                self._changes.append((period.start, period.rates))
        schedule = Schedule.from_rates(self._changes)
        told = pale_well(Known(rig=self._rig, pumped=schedule, times=[time], maps=[observed]), [0])
        self._pale = 0 if told is None else self._pale + 1
        return told if self._pale >= MAPS_IN_A_ROW else None

    def amount(
        self,
        observed: FloatArray,
        state: FloatArray,
        predicted: FloatArray,
        *,
        pumped: float,
        assumed: float,
    ) -> Remark | None:
        """Return the remark that a photograph does not hold the tracer of the pumps; None if so.

        The volumes are sums of concentration times pore volume over the observed cells.

        Args:
            observed: concentration in the photograph [-], (nz, nx); NaN where nothing was seen.
            state: the state before, (nz, nx) [-].
            predicted: the prediction from it for the photograph, (nz, nx) [-].
            pumped: tracer that the pumps injected meanwhile, by their rates [m^3].
            assumed: tracer that the prediction injected [m^3].
        """
        before, after = (float(np.sum(self._storage * one)) for one in (state, predicted))
        if math.isnan(self._pumped):
            self._pumped = before
        left = max(before + assumed - after, 0.0)
        self._pumped = max(self._pumped + pumped - left, 0.0)
        share = self._pumped / after if after > 0.0 else 0.0
        seen = np.isfinite(observed)
        found = float(np.sum((self._storage * observed)[seen]))
        expected = share * float(np.sum((self._storage * predicted)[seen]))
        rates = Schedule.from_rates(self._changes)
        return amount_remark(found, expected, self._rig.pore_volume, 'the photograph', rates)
