"""Which rates were in force, when, and how sure: the one answer of hub, siblings and diagnosis.

A rate in force follows from orders, confirmations and meters, the surest first:

1. Measured rates count in their period. Of several known rates the latest begun count.
2. Confirmed rates count from their time until the next order is set, or the setpoint ends.
3. A setpoint counts when the pumps have taken it. Pumps that set themselves take it at once. A
   person who has told when an order was set is expected to tell the next one too: until then the
   rates before it count, for `MOST_DELAY_S` at most. Who has not told by then tells no more. A
   change that no hand sets is no order for a person (`same_by_hand`); such changes add up.
4. A setpoint that has ended without a successor leaves the safe rates: the asset sets them itself.
5. Where nothing was told, measured rates go on, else the safe rates are assumed.

Announced pauses act on all rates that were not measured or confirmed since.

Three answers stood here before, and differed. All of them held the first order from its setpoint
on, even where the first confirmation told otherwise. The siblings and the diagnosis let an ended
setpoint go on. The diagnosis let an order that nobody told count from its setpoint on, once it was
10 min old, and did not know announced pauses. The siblings let measured rates end where no
setpoint had come. The hub forgot rates that a person had set
otherwise than ordered, with the next, equal setpoint.
"""

import bisect
import itertools
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.stamps import SAME_STAMP_S, believed_start
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.order_delay import MOST_DELAY_S, OrderDelay, OrdersAhead, WaitingOrder
from porotwin_core.rates.rate_periods import (
    SAME_RATE,
    KnownRates,
    RatePeriod,
    different_wells,
    joined,
    largest_rate,
    same_by_hand,
    same_rates,
)
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import RateStep, WellRates, mean_rates, with_rises
from porotwin_core.rig import Rig

_Key = tuple[type, float, float]

MOST_EVENTS = 4096
"""Setpoints and known rates that are kept one by one: photographs every 30 s for 17 hours. Of more,
the older half becomes periods, and pairs of these their mean rates, which keep the volumes."""


class Source(Enum):
    """Why rates count as in force, the surest first."""

    MEASURED = 'measured'
    CONFIRMED = 'confirmed'
    COMMANDED = 'commanded'
    KEPT = 'kept'
    """From before: an order is not set yet, or nothing has been told since a measurement."""
    SAFE = 'safe'
    ASSUMED = 'assumed'


class TracedPeriod(NamedTuple):
    """Constant rates [m^3/s] from `start` to `end` [s], and why they count."""

    start: float
    end: float
    rates: WellRates
    source: Source


class Order(NamedTuple):
    """The rates of a setpoint [m^3/s], from the `start` of its photograph until it ends [s]."""

    start: float
    rates: WellRates
    valid_until: float = math.inf


class _Stretch(NamedTuple):
    """Rates from `start` [s] to the next stretch.

    Pauses that begin or end after `known_at` [s] act on them; -inf: all pauses do.
    """

    start: float
    rates: WellRates
    source: Source
    known_at: float = -math.inf


@dataclass
class _Course:
    """The rates without measurements, after all events so far; each event goes on from there."""

    safe: WellRates
    wells: tuple[str, ...]
    stretches: list[_Stretch]
    told: WellRates
    """The last order, or the rates that a person told to have set."""
    by_hand: float = SAME_RATE
    """Rates that differ by at most this are the same to a person [m^3/s]."""
    order: Order | None = None
    delay: OrderDelay = field(default_factory=OrderDelay)

    def copy(self) -> '_Course':
        return replace(self, stretches=list(self.stretches))

    def at(self, time: float) -> _Stretch:
        """Return the stretch at `time` [s]; the first one reaches back."""
        begun = bisect.bisect_right(self.stretches, time, key=lambda one: one.start)
        return self.stretches[max(begun - 1, 0)]

    def take(self, event: Order | KnownRates) -> None:
        """Go on to an event."""
        self.run_to(event.start)
        if isinstance(event, Order):
            self._command(event)
        elif event.is_open:
            self._confirm(event)
        else:
            self._measure(event)

    def run_to(self, time: float) -> None:
        """Let setpoints and waits end before `time` [s]."""
        while True:
            waiting = self.delay.waiting
            away = waiting[0].time + MOST_DELAY_S if waiting else math.inf
            ends = self.order.valid_until if self.order is not None else math.inf
            if not min(away, ends) < time:
                return
            if away < ends:
                self._stop_waiting(away)
            else:
                self._expire(ends)

    def _command(self, order: Order) -> None:
        last = self.stretches[-1]
        same = self.by_hand if self.delay.a_person_tells else SAME_RATE
        changed = different_wells(order.rates, self.told, same=same)
        if changed:
            waiting = WaitingOrder(
                order.start, order.rates, self.told, last.rates, last.known_at, self.wells
            )
            self.delay = replace(self.delay, waiting=(*self.delay.waiting, waiting))
            if self.delay.a_person_tells:
                self._go_on(last._replace(start=order.start, source=Source.KEPT))
            else:
                self._go_on(_Stretch(order.start, order.rates, Source.COMMANDED))
        elif last.source in (Source.SAFE, Source.ASSUMED):
            self._go_on(_Stretch(order.start, order.rates, Source.COMMANDED))
        kept = {name: rate for name, rate in self.told.items() if name not in changed}
        self.order, self.told = order, {**order.rates, **kept}

    def _confirm(self, known: KnownRates) -> None:
        found = self.delay.newest_set(known)
        if found is not None:
            if not self.delay.a_person_tells and not self._confirmed_since(found.time):
                # nobody was expected to tell it, so that it counted from the beginning
                self._go_back_to(found.time)
                kept = _Stretch(found.time, found.pumped, Source.KEPT, found.known_at)
                self.stretches.append(kept)
            self.delay = self.delay.after(found, known)
        self._go_on(_Stretch(known.start, known.rates, Source.CONFIRMED, known.start))
        self.told = known.rates

    def _confirmed_since(self, time: float) -> bool:
        return any(one.source is Source.CONFIRMED and one.start >= time for one in self.stretches)

    def _measure(self, known: KnownRates) -> None:
        found = self.delay.newest_set(known)
        if found is not None:
            self.delay = self.delay.after(found, known)
            if self.delay.a_person_tells:
                self._go_on(_Stretch(known.start, found.rates, Source.COMMANDED))
        if self.order is None and self.stretches[-1].source is not Source.CONFIRMED:
            self._go_on(_Stretch(known.start, known.rates, Source.KEPT, known.end))
            self.told = known.rates

    def _expire(self, time: float) -> None:
        self._go_on(_Stretch(time, self.safe, Source.SAFE))
        self.order, self.told = None, self.safe
        self.delay = replace(self.delay, waiting=())

    def _stop_waiting(self, time: float) -> None:
        """Take the newest order as set: who has not told the oldest one until now is away."""
        if self.delay.a_person_tells and self.stretches[-1].source is Source.KEPT:
            assert self.order is not None
            self._go_on(_Stretch(time, self.order.rates, Source.COMMANDED))
        self.delay = replace(self.delay, waiting=self.delay.waiting[1:], a_person_tells=False)

    def _go_on(self, stretch: _Stretch) -> None:
        """Let a stretch begin; one that was over before the first kept one comes too late."""
        if stretch.start >= self.stretches[0].start:
            self._go_back_to(stretch.start)
            self.stretches.append(stretch)

    def _go_back_to(self, time: float) -> None:
        """Forget the stretches that begin at `time` [s] or later."""
        while self.stretches and self.stretches[-1].start >= time:
            self.stretches.pop()


class RateHistory:
    """The rates of all wells, as setpoints, pumps and operator tell them.

    Events are only added. Each answer follows from all events so far, so that it may change where
    nothing was measured or confirmed. Times [s] are by the clock of the photographs.
    """

    def __init__(
        self,
        safe: WellRates,
        control_wells: Sequence[str] = (),
        known_wells: Sequence[str] | None = None,
        announced: FixedPauses = NO_PAUSES,
        by_hand: float = SAME_RATE,
    ) -> None:
        """Know of no event.

        Args:
            safe: rates [m^3/s] until any others are known, and after a setpoint has ended.
            control_wells: the wells that orders change.
            known_wells: all wells of the rig; None: any names will do.
            announced: pauses of the fixed wells and levels, since the start of the experiment.
            by_hand: rates that differ by at most this are the same to a person [m^3/s].
        """
        self._safe = safe
        self._known_wells = known_wells
        self._events: dict[_Key, Order | KnownRates] = {}
        """In the order of their arrivals."""
        self._past: list[TracedPeriod] = []
        self.begins: float | None = None
        """Time of the first event, or of the first by this clock [s]; None: there is none."""
        start = _Stretch(-math.inf, safe, Source.ASSUMED)
        self._first = _Course(safe, tuple(control_wells), [start], safe, by_hand)
        """The course before all events that are kept."""
        self._announced = announced
        self.pauses: FixedPauses = NO_PAUSES
        """Announced pauses of the fixed wells, and levels of water, since `began`."""
        self.told_start: float | None = None
        """Start of the experiment [s] as imaging told it last; None: it told none."""
        self._largest = math.inf
        self._began_untold = False
        self.began: float | None = None
        """The start that is believed [s]; None: no state was reached yet."""
        self.most_events = MOST_EVENTS
        """Events that are kept one by one."""

    @classmethod
    def of(cls, rig: Rig, told_start: float | None = None) -> 'RateHistory':
        """Return the history of `rig` before its first event; its start [s] may be known."""
        control_wells = rig.control.wells if rig.control is not None else ()
        history = cls(
            safe_rates(rig),
            control_wells,
            tuple(rig.wells),
            FixedPauses.of(rig),
            same_by_hand(rig),
        )
        history.told_start = told_start
        history._largest = largest_rate(rig)
        return history

    @property
    def control_wells(self) -> tuple[str, ...]:
        """The wells that orders change."""
        return self._first.wells

    @control_wells.setter
    def control_wells(self, wells: Sequence[str]) -> None:
        self._first.wells = tuple(wells)

    # --- events -------------------------------------------------------------------------------

    def add_commanded(self, stamp: float, rates: WellRates, valid_until: float = math.inf) -> None:
        """Add a setpoint, from the `stamp` [s] of its photograph until it ends [s].

        Of two setpoints with one stamp, the one that arrived later counts.

        Raises:
            InputError: a well is unknown.
        """
        self._add(Order(stamp, rates, valid_until))

    def add_known(self, known: KnownRates) -> None:
        """Add rates that were measured or confirmed; the later ones of the same times count.

        Raises:
            InputError: a well is unknown, or no pump can have pumped so.
        """
        known.refuse_impossible(self._largest)
        self._add(known)

    def take_back(self, stamp: float) -> None:
        """Forget the setpoint of `stamp` [s], which the asset did not take."""
        self._events.pop(_key(Order(stamp, {})), None)

    def _add(self, event: Order | KnownRates) -> None:
        unknown = sorted(set(event.rates) - set(self._known_wells or event.rates))
        if unknown:
            known = ', '.join(self._known_wells or ())
            raise InputError(f"well '{unknown[0]}' is not in rig.yaml; known: {known}")
        self._events.pop(_key(event), None)
        self._events[_key(event)] = event
        if not self._past:
            self.begins = event.start if self.begins is None else min(self.begins, event.start)
        if len(self._events) > self.most_events:
            self._condense()

    def reach(self, stamp: float) -> None:
        """Count pauses and levels from the start that is believed at a state of `stamp` [s]."""
        if self._began_untold and self.told_start is not None:
            self.began = None  # who joined a run before it heard of the start believes it now
        self._began_untold = self.told_start is None
        self.began = believed_start(self.told_start, self.began, stamp)
        self.pauses = self._announced.since(self.began)

    def begin_anew(self, time: float) -> None:
        """Take it that the clock was set to `time` [s]: no earlier time means anything now.

        The rates in force go on. Events that came last and are not later than `time` are already
        by the new clock, as the rates that come just before the first photograph.
        """
        self.began = None
        events = list(self._events.items())
        late = itertools.takewhile(lambda item: item[1].start <= time, reversed(events))
        new = list(late)[::-1]
        old = events[: len(events) - len(new)]
        if self.begins is not None:
            self._events = dict(old)
            last = self._course().stretches[-1].rates
            start = _Stretch(-math.inf, last, Source.ASSUMED)
            self._first = _Course(self._safe, self._first.wells, [start], last, self._first.by_hand)
            self._past, self._events, self.begins = [], dict(new), time

    def forget_before(self, time: float) -> None:
        """Forget the rates before `time` [s]."""
        self._settle(time)
        self._past = []

    def _settle(self, time: float) -> None:
        """Make one course of all events before `time` [s], but for measurements that go on."""
        self._first = self._course_until(time)
        self._first.stretches = self._first.stretches[-1:]
        self._events = {
            key: event
            for key, event in self._events.items()
            if event.start >= time or (isinstance(event, KnownRates) and event.end > time)
        }

    def _condense(self) -> None:
        """Make periods of the older half of the events, and fewer periods of their older half."""
        middle = sorted(event.start for event in self._events.values())[len(self._events) // 2]
        assert self.begins is not None
        if self.begins < middle:
            self._past = list(self.traced(self.begins, middle))
            self._settle(middle)
        while len(self._past) > self.most_events:
            half = len(self._past) // 4 * 2
            pairs = zip(self._past[0:half:2], self._past[1:half:2], strict=True)
            self._past = [*(_both(*pair) for pair in pairs), *self._past[half:]]

    # --- questions ----------------------------------------------------------------------------

    def traced(self, start: float, end: float) -> tuple[TracedPeriod, ...]:
        """Return the rates in force from `start` to `end` [s], and the source of each."""
        past = [
            period._replace(start=max(period.start, start), end=min(period.end, end))
            for period in self._past
            if period.start < end and period.end > start
        ]
        later = max(start, self._past[-1].end) if self._past else start
        return (*past, *self._traced_later(later, end))

    def periods(self, start: float, end: float) -> tuple[RatePeriod, ...]:
        """Return the rates in force from `start` to `end` [s], and the levels that change.

        Neighbours of equal rates are joined.
        """
        pumped = joined(RatePeriod(*period[:3]) for period in self.traced(start, end))
        return tuple(
            RatePeriod(low, high, with_rises(period.rates, rises))
            for period in pumped
            for low, high, rises in self.pauses.levels.parts(period.start, period.end)
        )

    def at(self, time: float) -> WellRates:
        """Return the rates in force from `time` [s] on, as far as they are known."""
        return self._traced_later(time, math.nextafter(time, math.inf))[-1].rates

    def until(self, time: float) -> WellRates:
        """Return the rates in force until `time` [s]."""
        return self._traced_later(math.nextafter(time, -math.inf), time)[-1].rates

    def order(self, time: float) -> Order | None:
        """Return the setpoint in force at `time` [s]; None: there is none, or it has ended."""
        orders = [event for event in self._events.values() if isinstance(event, Order)]
        given = [event for event in orders if event.start <= time]
        newest = max(given, key=lambda event: event.start, default=self._first.order)
        return newest if newest is not None and time <= newest.valid_until else None

    def commanded(self, time: float) -> WellRates:
        """Return the rates [m^3/s] that the pumps should deliver at `time` [s].

        Without a setpoint they are those in force.
        """
        order = self.order(time)
        return order.rates if order is not None else self._course_until(time).stretches[-1].rates

    def is_commanded(self, stamp: float) -> bool:
        """Return whether the setpoint of the photograph at `stamp` [s] is here."""
        order = self.order(stamp + SAME_STAMP_S)
        return order is not None and abs(order.start - stamp) < SAME_STAMP_S

    def ahead(self, now: float, pumped: WellRates) -> OrdersAhead:
        """Return the rates until an order that is given `now` [s] will be set.

        `pumped` are the rates in force [m^3/s].
        """
        return self._course_until(now).delay.ahead(now, pumped)

    def plan(self, time: float, horizon: float) -> tuple[RateStep, ...]:
        """Return the rates from `time` [s] over `horizon` [s], as far as they are known.

        An order that waits is set at once, or after the time that a person is expected to need for
        it. Announced pauses are in the plan.
        """
        course = self._course()
        course.run_to(time)
        ahead = course.delay.ahead(time, course.stretches[-1].rates)
        steps = [RateStep(0.0, course.stretches[-1].rates)]
        if ahead.waits:
            steps = [*ahead.steps]
            if not steps or not same_rates(steps[-1].rates, course.told):
                steps.append(RateStep(ahead.lead, course.told))
        return self.pauses.in_plan(steps, time, horizon)

    # --- the course ---------------------------------------------------------------------------

    def _course(self, until: float = math.inf) -> _Course:
        """Return the course after all events that began before `until` [s]."""
        course = self._first.copy()
        begun = [event for event in self._events.values() if event.start < until]
        for event in sorted(begun, key=lambda event: (event.start, isinstance(event, KnownRates))):
            course.take(event)
        return course

    def _course_until(self, time: float) -> _Course:
        course = self._course(time)
        course.run_to(time)
        return course

    def _traced_later(self, start: float, end: float) -> tuple[TracedPeriod, ...]:
        """Return the rates from `start` to `end` [s], after the periods of the past."""
        if not start < end:
            return ()
        course = self._course()
        course.run_to(end)
        known = (event for event in self._events.values() if isinstance(event, KnownRates))
        within = (one for one in known if not one.is_open and one.end > start and one.start < end)
        measured = deque(sorted(within, key=lambda one: one.start))
        edges = {one.start for one in course.stretches} | self.pauses.moments(start, end)
        edges |= {edge for one in measured for edge in (one.start, one.end)}
        times = [start, *sorted(edge for edge in edges if start < edge < end), end]
        found: list[TracedPeriod] = []
        going: list[KnownRates] = []
        for low, high in itertools.pairwise(times):
            while measured and measured[0].start <= low:
                going.append(measured.popleft())
            while going and going[-1].end <= low:
                going.pop()
            stretch = course.at(low)
            told = stretch.start if stretch.source is Source.CONFIRMED else -math.inf
            if going and told <= going[-1].start:
                period = TracedPeriod(low, high, going[-1].rates, Source.MEASURED)
            else:
                rates = stretch.rates
                middle = low + (high - low) / 2.0
                if stretch.known_at == -math.inf or self.pauses.moments(stretch.known_at, middle):
                    rates = self.pauses.at(middle, rates)
                period = TracedPeriod(low, high, rates, stretch.source)
            if found and found[-1][2:] == period[2:]:
                found[-1] = found[-1]._replace(end=high)
            else:
                found.append(period)
        return tuple(found)


def _key(event: Order | KnownRates) -> _Key:
    """Return the kind and the times of an event: the later of two that have them alike counts."""
    return type(event), event.start, 0.0 if isinstance(event, Order) else event.end


def _both(first: TracedPeriod, second: TracedPeriod) -> TracedPeriod:
    """Return one period for two, with mean rates and the less sure source."""
    rates = mean_rates((first[:3], second[:3]))
    least = max(first.source, second.source, key=list(Source).index)
    return TracedPeriod(first.start, second.end, rates, least)
