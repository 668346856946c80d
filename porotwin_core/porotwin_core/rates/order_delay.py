"""How long a person takes to set an order.

An order is a setpoint with other rates than those that the pumps were told last. Confirmations and
meters tell when it was set. The next order will take about as long, so that a plan begins after
that time.
"""

import itertools
import statistics
from dataclasses import dataclass
from typing import NamedTuple

from porotwin_core.rates.rate_periods import KnownRates, different_wells
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
class WaitingOrder:
    """An order that nobody has set yet.

    Attributes:
        time: when it was given [s].
        rates: the ordered rates [m^3/s].
        told: the rates that the pumps were told before.
        pumped: the rates in force then.
        known_at: when that was measured or confirmed [s]; -inf: never.
        wells: the control wells.
    """

    time: float
    rates: WellRates
    told: WellRates
    pumped: WellRates
    known_at: float
    wells: tuple[str, ...]

    @property
    def changed(self) -> list[str]:
        """The wells whose change shows that a person set the order.

        These are control wells: fixed wells pause by themselves, and a producer follows them. Only
        an order that changes no control well is judged by all wells.
        """
        changed = different_wells(self.rates, self.told)
        return [well for well in changed if well in self.wells] or changed

    def is_set_by(self, known: KnownRates) -> bool:
        """Return whether `known` rates show that it was set, perhaps at somewhat other rates.

        A confirmation shows it if any of its wells has changed; a meter, which is not exact, if one
        of them has gone half of the way.
        """
        if known.is_open:
            held = different_wells(known.rates, self.told)
            return any(well in held for well in self.changed)
        return any(
            abs(known.rates[well].rate - self.told[well].rate)
            > HALF_WAY * abs(self.rates[well].rate - self.told[well].rate)
            for well in self.changed
            if well in known.rates and well in self.told
        )


@dataclass(frozen=True)
class OrderDelay:
    """The orders that wait, the delays of the last ones [s], and whether a person tells them."""

    waiting: tuple[WaitingOrder, ...] = ()
    delays: tuple[float, ...] = ()
    a_person_tells: bool = False

    @property
    def expected(self) -> float:
        """Time until an order is set [s].

        It is the median of the last delays and of one order that was set at once: one order that
        took long may have had a reason of its own.
        """
        delay = statistics.median([0.0, *self.delays])
        return delay if delay > LEAST_DELAY_S else 0.0

    def newest_set(self, known: KnownRates) -> WaitingOrder | None:
        """Return the newest order that `known` rates show as set; orders are set in turn."""
        given = [order for order in self.waiting if order.time <= known.start]
        found = list(itertools.takewhile(lambda order: order.is_set_by(known), given))
        if known.is_open:
            found += [order for order in given if not different_wells(order.rates, known.rates)]
        return max(found, key=lambda order: order.time, default=None)

    def after(self, order: WaitingOrder, known: KnownRates) -> 'OrderDelay':
        """Return the knowledge after `known` rates showed that an `order` was set."""
        delay = min(known.start - order.time, MOST_DELAY_S)
        return OrderDelay(
            tuple(one for one in self.waiting if one.time > order.time),
            (*self.delays, delay)[-REMEMBERED_DELAYS:],
            self.a_person_tells or known.is_open,
        )

    def ahead(self, now: float, pumped: WellRates) -> OrdersAhead:
        """Return the rates until an order that is given `now` [s] will be set.

        Args:
            now: the time [s].
            pumped: the rates in force [m^3/s].
        """
        lead, waits = self.expected, bool(self.waiting)
        if lead == 0.0:
            return OrdersAhead(waits=waits)
        due = [order for order in self.waiting if order.time + lead > now]
        steps = {0.0: pumped} | {max(order.time + lead - now, 0.0): order.rates for order in due}
        ahead = tuple(RateStep(start, rates) for start, rates in steps.items() if start < lead)
        return OrdersAhead(lead, ahead, waits=waits)
