"""Notices maps with little tracer at a well that injects it: the baseline shows tracer already."""

from collections import deque
from collections.abc import Sequence

from porotwin_checks.checks.tracer_at_wells import pale_well
from porotwin_checks.known import Known
from porotwin_core.basis.remark import Remark
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.rates_in_force import RatePeriod
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import Rig

MAPS_IN_A_ROW = 3
"""Pale maps in a row that are told; a tube or a cover may hide the tracer in one."""

MOST_CHANGES = 1000
"""Changes of rates that are remembered: some hours of metered pumps fill a well many times."""


class PaleWells:
    """Remembers what the wells have injected, and compares it with each map."""

    def __init__(self, rig: Rig) -> None:
        """Begin without any injection into `rig`."""
        self._rig = rig
        self._changes: deque[tuple[float, WellRates]] = deque(maxlen=MOST_CHANGES)
        self._pale = 0

    def forget(self) -> None:
        """Forget all injections: nobody knows what the wells held in between."""
        self._changes.clear()
        self._pale = 0

    def remark(
        self, observed: FloatArray, time: float, periods: Sequence[RatePeriod]
    ) -> Remark | None:
        """Return a remark about a pale well; None without one.

        Args:
            observed: concentration in the photograph [-], (nz, nx); NaN where nothing was seen.
            time: time of the photograph [s].
            periods: the rates since the photograph before.
        """
        for period in periods:
            if not self._changes or self._changes[-1][1] != period.rates:
                self._changes.append((period.start, period.rates))
        schedule = Schedule.from_rates(self._changes)
        told = pale_well(Known(rig=self._rig, rates=schedule, times=[time], maps=[observed]), [0])
        self._pale = 0 if told is None else self._pale + 1
        return told if self._pale >= MAPS_IN_A_ROW else None
