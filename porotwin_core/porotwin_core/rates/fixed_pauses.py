"""What is announced of a run: pauses of wells that the twin does not change, levels of water.

State estimates, forecasts, plans and siblings ask here which fixed wells rest at a time.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from porotwin_core.basis.spans import is_within
from porotwin_core.basis.units import MINUTE_S, from_ml_h
from porotwin_core.rates.water_levels import NO_LEVELS, WaterLevels
from porotwin_core.rates.wells import (
    RateStep,
    Schedule,
    ScheduleRow,
    WellRate,
    WellRates,
    planned_rates,
    with_rises,
)
from porotwin_core.rig import Rig

Pause = tuple[float, float]
"""Start and end of a pause [s]."""


@dataclass(frozen=True)
class FixedPauses:
    """The announced pauses of each fixed well, and the announced levels of water.

    Attributes:
        of_wells: the pauses by well in order, in seconds since the start of the experiment, or on
            the clock of `since`.
        running: the rate of each of these wells outside its pauses [m^3/s].
        producer: the well that takes out the water of all others; None: there is none.
        levels: the levels that change, on the same clock.
    """

    of_wells: Mapping[str, tuple[Pause, ...]] = field(default_factory=dict)
    running: Mapping[str, WellRate] = field(default_factory=dict)
    producer: str | None = None
    levels: WaterLevels = NO_LEVELS

    @classmethod
    def of(cls, rig: Rig) -> 'FixedPauses':
        """Return the pauses in `rig.yaml`, in seconds since the start of the experiment.

        Whoever rests at its end rests on.
        """
        fixed = rig.control.fixed if rig.control is not None else {}
        pausing = {name: well for name, well in fixed.items() if well.pauses_min}
        if rig.control is None or not pausing:
            return cls(levels=WaterLevels.of(rig))
        last = rig.control.end_min
        return cls(
            {
                name: tuple(
                    (MINUTE_S * start, math.inf if end == last else MINUTE_S * end)
                    for start, end in well.pauses_min
                )
                for name, well in pausing.items()
            },
            {
                name: WellRate(from_ml_h(well.rate_ml_h), well.concentration)
                for name, well in pausing.items()
            },
            rig.control.producer,
            WaterLevels.of(rig),
        )

    def since(self, began: float) -> 'FixedPauses':
        """Return the pauses on a clock that showed `began` [s] at the start of the experiment."""
        moved = {
            name: tuple((began + start, began + end) for start, end in pauses)
            for name, pauses in self.of_wells.items()
        }
        return replace(self, of_wells=moved, levels=self.levels.since(began))

    def moments(self, begin: float, end: float) -> set[float]:
        """Return when a pause begins or ends between `begin` and `end` [s], both left out."""
        edges = {edge for pauses in self.of_wells.values() for pause in pauses for edge in pause}
        return {edge for edge in edges if begin < edge < end}

    def resting(self, time: float) -> frozenset[str]:
        """Return the wells that pause at `time` [s]."""
        return frozenset(name for name, pauses in self.of_wells.items() if is_within(time, pauses))

    def at(self, time: float, rates: WellRates) -> WellRates:
        """Return the `rates` [m^3/s] that nobody has measured, with the pauses at `time` [s].

        A well rests in its pauses. Outside them it runs again if `rates` let it rest. The producer
        takes out as much less or more.
        """
        return self._running(self.rested(time, rates), self.resting(time))

    def all_running(self, rates: WellRates) -> WellRates:
        """Return `rates` [m^3/s] with all these wells running, as outside of their pauses."""
        return self._running(rates, frozenset())

    def _running(self, rates: WellRates, resting: frozenset[str]) -> WellRates:
        stopped = {
            name: usual
            for name, usual in self.running.items()
            if name not in resting and rates.get(name, WellRate()).rate == 0.0
        }
        return self._changed(rates, stopped)

    def rested(self, time: float, rates: WellRates) -> WellRates:
        """Return the planned `rates` [m^3/s] with the wells at rest that pause at `time` [s].

        A well that the plan lets rest stays at rest. The producer takes out as much less.
        """
        pumping = (name for name in self.resting(time) if rates.get(name, WellRate()).rate != 0.0)
        return self._changed(rates, dict.fromkeys(pumping, WellRate()))

    def _changed(self, rates: WellRates, changed: Mapping[str, WellRate]) -> WellRates:
        """Return `rates` with `changed` ones; the producer balances the change, and never injects.

        Plans may let a producer take out less than is injected, where water leaves by itself.
        """
        if not changed:
            return rates
        result = {**rates, **changed}
        if self.producer is not None:
            more = sum(new.rate - rates.get(name, WellRate()).rate for name, new in changed.items())
            producer = rates.get(self.producer, WellRate())
            result[self.producer] = replace(producer, rate=min(producer.rate - more, 0.0))
        return result

    def in_schedule(self, schedule: Schedule) -> Schedule:
        """Return the rates of a `schedule` that will be run: with the pauses, see `rested`."""
        if not self.of_wells:
            return replace(schedule, levels=self.levels)
        own: dict[float, dict[str, WellRate]] = {}
        for row in schedule.rows:
            own.setdefault(row.time, {})[row.well] = row.rate
        rows: list[ScheduleRow] = []
        planned: WellRates = {}
        before: WellRates = {}
        for time in sorted({*own, *self.moments(min(own, default=0.0), math.inf)}):
            planned = {**planned, **own.get(time, {})}
            rates = self.rested(time, planned)
            rows += [
                ScheduleRow(time, name, rate)
                for name, rate in rates.items()
                if name in own.get(time, {}) or rate != before.get(name, WellRate())
            ]
            before = rates
        return Schedule(tuple(rows), self.levels)

    def rested_plan(
        self, plan: Sequence[RateStep], begin: float, horizon: float
    ) -> tuple[RateStep, ...]:
        """Return a proposed `plan` from `begin` [s] over `horizon` [s], with the pauses.

        A proposal may stop a well outside them too, see `rested`.
        """
        return tuple(
            RateStep(start, self.rested(begin + start, planned_rates(plan, start)))
            for start in self._starts(plan, begin, horizon)
        )

    def _starts(self, plan: Sequence[RateStep], begin: float, horizon: float) -> list[float]:
        """Return when the rates of a `plan` from `begin` [s] or a pause change, after it [s]."""
        edges = {moment - begin for moment in self.moments(begin, begin + horizon)}
        return sorted({*edges, *(step.start for step in plan)})

    def in_plan(
        self, plan: Sequence[RateStep], begin: float, horizon: float
    ) -> tuple[RateStep, ...]:
        """Return a `plan` of the rates from `begin` [s] over `horizon` [s], as announced."""
        starts = self._starts(plan, begin, horizon)
        rested = [
            RateStep(start, self.at(begin + start, planned_rates(plan, start))) for start in starts
        ]
        ends = [*starts[1:], horizon]
        return tuple(
            RateStep(step.start + (low - (begin + step.start)), with_rises(step.rates, rises))
            for step, end in zip(rested, ends, strict=True)
            for low, _, rises in self.levels.parts(begin + step.start, begin + end)
        )


NO_PAUSES = FixedPauses()
"""No fixed well pauses."""
