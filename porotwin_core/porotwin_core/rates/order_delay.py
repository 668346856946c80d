"""How long a person takes to set an order, and the rates in force until then.

An order is a setpoint with other rates than the one before. Confirmations and meters tell when it
was set. The next order will take about as long, so that a plan begins after that time.
"""

import itertools
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from porotwin_core.rates.rates_in_force import KnownRates, different_wells
from porotwin_core.rates.wells import RateStep, WellRates

REMEMBERED_DELAYS = 5
"""Orders whose delays count: a shift has one person at the pumps."""

LEAST_DELAY_S = 20.0
"""Shorter delays do not matter to a plan [s]: its shortest block is as long."""

MOST_DELAY_S = 600.0
"""Longest delay that is counted with [s]; then the person is away, and delays say nothing."""


HALF_WAY = 0.5
"""A measured rate shows that an order was set if it has gone this share of the ordered change."""


class OrdersAhead(NamedTuple):
    """The rates in force until an order that is given now will be set.

    `lead` is that time [s]; `steps` are the rates of all wells from 0 to then, empty where it is 0.
    `waits` tells whether an order was given that nobody has set yet.
    """

    lead: float = 0.0
    steps: tuple[RateStep, ...] = ()
    waits: bool = False


AT_ONCE = OrdersAhead()
"""An order is set at once, and none is waited for."""


@dataclass(frozen=True)
class _Order:
    """Rates [m^3/s] ordered at `time` [s], after those of `before`, to the control `wells`."""

    time: float
    rates: WellRates
    before: WellRates
    wells: tuple[str, ...] = ()

    @property
    def changed(self) -> list[str]:
        """The wells whose change shows that a person set the order.

        These are control wells: fixed wells pause by themselves, and a producer follows them. Only
        an order that changes no control well is judged by all wells.
        """
        changed = different_wells(self.rates, self.before)
        return [well for well in changed if well in self.wells] or changed

    def is_set_by(self, known: KnownRates) -> bool:
        """Return whether `known` rates show that it was set, perhaps at somewhat other rates.

        A confirmation shows it if any of its wells has changed; a meter, which is not exact, if one
        of them has gone half of the way.
        """
        if known.is_open:
            held = different_wells(known.rates, self.before)
            return any(well in held for well in self.changed)
        return any(
            abs(known.rates[well].rate - self.before[well].rate)
            > HALF_WAY * abs(self.rates[well].rate - self.before[well].rate)
            for well in self.changed
            if well in known.rates and well in self.before
        )


class OrderDelay:
    """Learns how long orders take, and remembers those that wait."""

    def __init__(self) -> None:
        """Know of no order."""
        self.begin_anew()

    def begin_anew(self) -> None:
        """Forget everything."""
        self._delays: deque[float] = deque(maxlen=REMEMBERED_DELAYS)
        self._waiting: list[_Order] = []
        self._a_person_tells = False

    @property
    def expected(self) -> float:
        """Time until an order is set [s].

        It is the median of the last delays and of one order that was set at once: one order that
        took long may have had a reason of its own.
        """
        delay = statistics.median([0.0, *self._delays])
        return delay if delay > LEAST_DELAY_S else 0.0

    def ordered(
        self, time: float, rates: WellRates, before: WellRates, wells: tuple[str, ...] = ()
    ) -> None:
        """Take the `rates` of a setpoint [m^3/s] at `time` [s], after those of the one `before`.

        `wells` are the control wells.
        """
        if different_wells(rates, before):
            self._waiting.append(_Order(time, rates, before, wells))

    def take_back(self, time: float) -> None:
        """Forget an order of `time` [s], which the asset did not take."""
        self._waiting = [order for order in self._waiting if order.time != time]

    def learn(self, known: Sequence[KnownRates], now: float) -> None:
        """Learn from rates that were confirmed or measured up to `now` [s]."""
        for item in sorted(known, key=lambda item: item.start):
            order = self._newest_set(item)
            if order is not None:
                self._delays.append(min(item.start - order.time, MOST_DELAY_S))
                self._a_person_tells |= item.is_open
                self._waiting = [one for one in self._waiting if one.time > order.time]
        self._waiting = [order for order in self._waiting if now - order.time <= MOST_DELAY_S]

    def _newest_set(self, known: KnownRates) -> _Order | None:
        """Return the newest order that `known` rates show as set; orders are set in turn."""
        given = [order for order in self._waiting if order.time <= known.start]
        found = list(itertools.takewhile(lambda order: order.is_set_by(known), given))
        if known.is_open:
            found += [order for order in given if not different_wells(order.rates, known.rates)]
        return max(found, key=lambda order: order.time, default=None)

    def believed(self, commanded: WellRates, before: WellRates) -> WellRates:
        """Return the rates in force [m^3/s] where nothing is known since the rates `before`.

        A person who has told before when an order was set is expected to tell it again. Until the
        first answer, and where pumps set themselves, the `commanded` rates count as pumped: the
        reports of their meters come later.
        """
        return before if self._waiting and self._a_person_tells else commanded

    def ahead(self, now: float, pumped: WellRates) -> OrdersAhead:
        """Return the rates until an order that is given `now` [s] will be set.

        Args:
            now: the time [s].
            pumped: the rates in force [m^3/s].
        """
        lead, waits = self.expected, bool(self._waiting)
        if lead == 0.0:
            return OrdersAhead(waits=waits)
        due = [order for order in self._waiting if order.time + lead > now]
        steps = {0.0: pumped} | {max(order.time + lead - now, 0.0): order.rates for order in due}
        ahead = tuple(RateStep(start, rates) for start, rates in steps.items() if start < lead)
        return OrdersAhead(lead, ahead, waits=waits)
