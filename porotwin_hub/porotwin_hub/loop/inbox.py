"""The inbox of the hub: matches messages of different topics, and orders them by their stamps.

Topics keep no order between them, so everything counts by its stamp: a state is ready when it is
here and refreshed, in whichever order the two messages arrive; an interruption or a rate belongs
to the interval that its stamp lies in. A stamp that is not believed orders nothing: its state is
handed out and leaves no trace. This module knows neither messages nor ROS.
"""

import math
import queue
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

from porotwin_core.clock.freshness import IN_TIME, StampJudgement
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.rate_periods import KnownRates

WAITING_STATES = 64
"""States that wait in simulated time, which leaves none out, or for their refreshed message, and
interruptions that wait for the next state: a burst on their topic."""

REMEMBERED_RATES = 1024
"""Known rates that wait for the next state: a flow meter at 10 Hz, photographs every 100 s."""

Envelope = TypeVar('Envelope')

JudgeFn = Callable[[float, float], StampJudgement]
"""Judges the stamp [s] of a photograph from its arrival [s]; see `PhotographClock.judge`."""


@dataclass(frozen=True)
class ArrivedState(Generic[Envelope]):
    """A state of the asset.

    `sequence` is its number, `stamp` the time of its photograph [s], `concentration` its map
    (nz, nx) [-]. The `envelope` (the message) is passed on untouched. A `doubt` about its origin
    counts as a doubt about its stamp. `deviation` is the standard deviation of its map, and
    `systematic` the part of it that stays the same from photograph to photograph; None: not known.
    """

    sequence: int
    stamp: float
    concentration: FloatArray
    envelope: Envelope
    doubt: str = ''
    deviation: FloatArray | None = None
    systematic: FloatArray | None = None


@dataclass(frozen=True)
class ReadyState(Generic[Envelope]):
    """A refreshed state with everything that belongs to it.

    Attributes:
        state: the state.
        arrival: when it was ready, by the clock given to the inbox [s].
        judgement: the belief about its stamp.
        known: rates measured or confirmed since the last state that was taken.
        interruptions: reasons why it does not follow from the last state; empty: it does.
        skipped: states that were ready too, but older.
        doubts: why the stamps of this state, or of states that were ready too, are not believed.
        time_went_back: whether its stamp is not later than the last one.
    """

    state: ArrivedState[Envelope]
    arrival: float
    judgement: StampJudgement = IN_TIME
    known: tuple[KnownRates, ...] = ()
    interruptions: tuple[str, ...] = ()
    skipped: int = 0
    doubts: tuple[str, ...] = ()
    time_went_back: bool = False

    @property
    def is_believed(self) -> bool:
        """Whether the stamp of the state is believed."""
        return not self.judgement.doubt


@dataclass
class _Timeline:
    """Events by stamp, and the stamp of the last state that was taken."""

    last_stamp: float = -math.inf
    rates: deque[KnownRates] = field(default_factory=lambda: deque(maxlen=REMEMBERED_RATES))
    interruptions: deque[tuple[float, str]] = field(
        default_factory=lambda: deque(maxlen=WAITING_STATES)
    )


class Inbox(Generic[Envelope]):
    """Collects messages from several threads; `take` hands out one ready state after the other."""

    def __init__(
        self,
        clock: Callable[[], float],
        *,
        judge: JudgeFn | None = None,
        clock_tolerance: float = math.inf,
    ) -> None:
        """Make an empty inbox.

        Args:
            clock: returns the time [s]; it is asked whenever a state becomes ready.
            judge: judges the stamps of states, in the order of their arrivals; None: in simulated
                time all are believed, and no state is left out.
            clock_tolerance: rates whose time lies further [s] outside the interval of two states
                have another clock than the camera; they count from the earlier state on.
        """
        self.now = clock
        """The clock of arrivals [s]."""
        self._judge = judge
        self._clock_tolerance = clock_tolerance
        self._states: dict[int, ArrivedState[Envelope]] = {}
        self._refreshed: deque[int] = deque(maxlen=WAITING_STATES)
        self._ready: queue.SimpleQueue[ReadyState[Envelope]] = queue.SimpleQueue()
        self._timeline = _Timeline()
        self._lock = threading.Lock()

    def add_state(self, state: ArrivedState[Envelope]) -> None:
        """Add a state of the asset."""
        with self._lock:
            self._states[state.sequence] = state
            self._match()

    def add_refreshed(self, sequence: int) -> None:
        """Add the message that the state `sequence` is complete.

        It may wait already: of a state with the same number that was refused, or sent twice.
        """
        with self._lock:
            if sequence not in self._refreshed:
                self._refreshed.append(sequence)
            self._match()

    def add_interruption(self, stamp: float, reason: str) -> None:
        """Add a clean state: states from `stamp` [s] on do not follow from earlier ones."""
        with self._lock:
            self._timeline.interruptions.append((stamp, reason))

    def add_rates(self, known: KnownRates) -> None:
        """Add rates that were measured or confirmed."""
        with self._lock:
            self._timeline.rates.append(known)

    def take(self, timeout: float | None = None) -> ReadyState[Envelope] | None:
        """Wait for a ready state; None after `timeout` [s].

        It is the newest one whose stamp is believed, if there is any. In simulated time it is the
        oldest one, so that the result does not depend on the speed of the machine.
        """
        try:
            ready = [self._ready.get(timeout=timeout)]
        except queue.Empty:
            return None
        most = WAITING_STATES if self._judge is None else 0
        while self._ready.qsize() > most:
            ready.append(self._ready.get())
        believed = [one for one in ready if one.is_believed]
        newest = (believed or ready)[-1]
        doubts = tuple(
            f'the photograph at {one.state.stamp:.3f} s is not used: {one.judgement.doubt}'
            for one in ready
            if not one.is_believed
        )
        skipped = max(len(believed) - 1, 0)
        with self._lock:
            return replace(self._complete(newest), skipped=skipped, doubts=doubts)

    def is_near(self, moment: float) -> bool:
        """Return whether `moment` [s] may be a time by the camera's clock, or by this one's."""
        near = (self._timeline.last_stamp, self.now())
        return any(abs(moment - time) <= self._clock_tolerance for time in near)

    def _match(self) -> None:
        for sequence in [number for number in self._refreshed if number in self._states]:
            self._refreshed.remove(sequence)
            self._ready.put(self._judged(self._states.pop(sequence)))
        for sequence in list(self._states)[:-WAITING_STATES]:
            del self._states[sequence]

    def _judged(self, state: ArrivedState[Envelope]) -> ReadyState[Envelope]:
        arrival = self.now()
        if state.doubt:
            return ReadyState(state, arrival, StampJudgement(0.0, state.doubt))
        if self._judge is None:
            return ReadyState(state, arrival)
        return ReadyState(state, arrival, self._judge(state.stamp, arrival))

    def _complete(self, ready: ReadyState[Envelope]) -> ReadyState[Envelope]:
        """Return `ready` with all events between the last state and this one."""
        if not ready.is_believed:
            return ready
        stamp, timeline = ready.state.stamp, self._timeline
        time_went_back = stamp <= timeline.last_stamp
        if time_went_back:
            timeline.last_stamp = -math.inf
            self._keep_rates(lambda item: item.start <= stamp)
        known = self._known_until(stamp)
        last = timeline.last_stamp
        interruptions = tuple(
            reason for moment, reason in timeline.interruptions if last < moment <= stamp
        )
        timeline.interruptions = deque(
            (event for event in timeline.interruptions if event[0] > stamp),
            maxlen=WAITING_STATES,
        )
        # rates confirmed at this very stamp begin the next interval; simulated time makes many
        self._keep_rates(lambda item: item.start >= stamp or item.end > stamp)
        timeline.last_stamp = stamp
        return replace(
            ready, known=known, interruptions=interruptions, time_went_back=time_went_back
        )

    def _known_until(self, stamp: float) -> tuple[KnownRates, ...]:
        """Return the rates that began before `stamp` [s], with times by the photographs' clock."""
        timeline, tolerance = self._timeline, self._clock_tolerance
        last = timeline.last_stamp
        timeline.rates = deque(
            (
                item
                if last - tolerance <= item.end <= stamp + tolerance
                else KnownRates(last, last, item.rates)
                for item in timeline.rates
            ),
            maxlen=REMEMBERED_RATES,
        )
        return tuple(item for item in timeline.rates if item.start < stamp)

    def _keep_rates(self, keep: Callable[[KnownRates], bool]) -> None:
        self._timeline.rates = deque(filter(keep, self._timeline.rates), maxlen=REMEMBERED_RATES)
