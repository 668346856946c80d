"""The age of photographs, from a camera's clock that need not agree with this machine's clock.

A photograph is late by its arrival minus its stamp. Lateness can only be added on the way, so the
smallest lateness of a live camera is the lag of its clock. Nothing else tells this lag: a pause
between two arrivals does not. `docs/clocks.md` states the policy and its limits.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from itertools import pairwise
from typing import NamedTuple

from porotwin_core.clock.photo_interval import VALIDITY_INTERVALS
from porotwin_core.clock.stamps import SAME_STAMP_S, SINCE_1970, steady_time

AGREEMENT = 0.5
"""A camera's clock agrees with this machine's if it is ahead by at most this part of the photo
interval. Setpoints follow from photographs that are fresh even then."""

JITTER = 0.25
"""Variation of the lateness of a live camera, as a part of the photo interval: transfer and imaging
take a few seconds more or less."""

LEARNING_PHOTOGRAPHS = 4
"""Photographs that tell a pace, and at a live pace prove a clock. Two are a backlog with one
pause."""

LEARNING_INTERVALS = 2.5
"""Photo intervals that these photographs span at least, also where a camera is faster."""

DRIFT = 1e-4
"""Largest share of time that a fast clock gains: nine seconds a day."""

REMEMBERED_STAMPS = 100_000
"""Stamps that are known again when a photograph comes twice: a month of one every 30 s."""

STALE_AFTER_S = 5.0
"""Nodes report their health every second; one that is silent for longer is stale [s], as in
diagnostic_aggregator."""

RESTART_AFTER_S = 30.0
"""A node that is silent for longer is ended [s]; its launcher starts it again."""


class StampJudgement(NamedTuple):
    """The belief about the time of a photograph.

    `age` is its age [s] on arrival. `doubt` says why its stamp is not believed, in one line; it is
    empty for a stamp that is believed, and `age` means nothing otherwise.
    """

    age: float
    doubt: str = ''


IN_TIME = StampJudgement(0.0)
"""The judgement in simulated time, which waits for the twin: no photograph is late."""


@dataclass(frozen=True)
class _LearntClock:
    """A clock that live photographs have proved: `behind` [s] at the arrival `since` [s]."""

    behind: float
    since: float


class PhotographClock:
    """Judges the stamps of photographs, one after the other in the order of their arrivals.

    At first the camera's clock counts as right. A few photographs at a live pace prove another
    clock, if the camera's clock was never found right, or if their stamps cannot come from the
    clock believed so far: they lie in the future, or before the last photograph. A clock that was
    found right stays believed when photographs are late.
    """

    def __init__(self, *, interval: float, validity: float) -> None:
        """Begin without any photograph.

        Args:
            interval: time between photographs [s].
            validity: age up to which a photograph may be acted on [s].
        """
        self._interval = interval
        self.most_age = validity - (1.0 + AGREEMENT) * interval
        """Age on arrival [s] up to which a photograph is fresh. Its setpoint then outlasts the next
        photograph, also if the clock is not exactly right."""
        self._behind = 0.0
        """Lag of the camera's clock behind the clock of arrivals [s]."""
        self._learnt: _LearntClock | None = None
        self._found_right = False
        """Whether a photograph was fresh by the clock that is believed."""
        self._latest = float('-inf')
        """Stamp of the last photograph whose stamp was believed [s]."""
        self._seen: deque[int] = deque(maxlen=REMEMBERED_STAMPS)
        self._seen_set: set[int] = set()
        self._evidence: deque[tuple[float, float]] = deque(maxlen=REMEMBERED_STAMPS // 1000)
        """Stamps and latenesses [s] of the photographs since the last fresh one."""

    def judge(self, stamp: float, arrival: float) -> StampJudgement:
        """Return the belief about a photograph.

        Args:
            stamp: the time of the photograph by the camera's clock [s].
            arrival: its arrival [s] since 1970, by a clock that is never set; that clock may be as
                wrong as the camera's.
        """
        if self._is_repeated(stamp):
            return StampJudgement(0.0, 'its stamp has come before, so the photograph is an old one')
        late = arrival - stamp
        doubt = self._doubt(stamp, late, arrival)
        if not doubt and late - self._behind <= self.most_age:
            self._behind = min(self._behind, late)
            self._found_right = True
            self._evidence.clear()
        elif doubt or not self._found_right:
            self._evidence.append((stamp, late))
            if self._learns(arrival):
                doubt = ''
        else:
            self._evidence.clear()
        if not doubt:
            self._latest = stamp
        return StampJudgement(late - self._behind, doubt)

    def _is_repeated(self, stamp: float) -> bool:
        """Return whether `stamp` [s] has come before, and remember it."""
        key = round(stamp / SAME_STAMP_S)
        if key in self._seen_set:
            return True
        if len(self._seen) == REMEMBERED_STAMPS:
            self._seen_set.discard(self._seen[0])
        self._seen.append(key)
        self._seen_set.add(key)
        return False

    def _doubt(self, stamp: float, late: float, arrival: float) -> str:
        """Return why the clock believed so far cannot have made `stamp`, or an empty string."""
        ahead = self._behind - late
        if ahead > self._tolerance_ahead(arrival):
            return f'its stamp lies {_duration(ahead)} in the future; set the clock of the camera'
        if stamp <= self._latest:
            back = _duration(self._latest - stamp)
            return f'its stamp lies {back} before the last photograph'
        if self._learnt is None and stamp < SINCE_1970:
            return f'its stamp is {stamp:.0f} s, no time since 1970; set the clock of the camera'
        return ''

    def _tolerance_ahead(self, arrival: float) -> float:
        if self._learnt is None:
            return self._behind + AGREEMENT * self._interval
        fallen = self._learnt.behind - self._behind
        drift = DRIFT * (arrival - self._learnt.since)
        return JITTER * self._interval + drift - fallen

    def _learns(self, arrival: float) -> bool:
        """Return whether the last photographs prove another clock, and believe it if so."""
        live = self._live_lateness()
        if len(live) < LEARNING_PHOTOGRAPHS:
            return False
        self._behind = min(live)
        self._learnt = _LearntClock(self._behind, arrival)
        self._found_right = True
        self._evidence.clear()
        return True

    def _live_lateness(self) -> list[float]:
        """Return the latenesses [s] of the last photographs at a live pace; empty: too short."""
        evidence = list(self._evidence)
        first = len(evidence) - 1
        lowest = highest = evidence[-1][1]
        while first > 0:
            (earlier, late), (later, _) = evidence[first - 1], evidence[first]
            lowest, highest = min(lowest, late), max(highest, late)
            if earlier >= later or highest - lowest > JITTER * self._interval:
                break
            first -= 1
        live = evidence[first:]
        spans = live[-1][0] - live[0][0]
        lateness = [late for _, late in live]
        short = spans < LEARNING_INTERVALS * self._interval
        return [] if short or _catches_up(lateness, spans) else lateness


def stamp_doubts(interval: float, *, simulated: bool) -> Callable[[float], str]:
    """Return a function of a stamp [s] that says why the hub does not believe it; '' if it does.

    It is called once for each photograph, when it arrives. `interval` is the time between
    photographs [s]. In `simulated` time all stamps are believed.
    """
    if simulated:
        return lambda _stamp: ''
    photographs = PhotographClock(interval=interval, validity=VALIDITY_INTERVALS * interval)
    return lambda stamp: photographs.judge(stamp, steady_time()).doubt


def _catches_up(lateness: list[float], duration: float) -> bool:
    """Return whether `lateness` [s] falls all the time, faster over `duration` [s] than clocks do.

    A backlog that is sent a little faster than it was taken looks like this.
    """
    falls = all(after < before for before, after in pairwise(lateness))
    return falls and lateness[0] - lateness[-1] > DRIFT * duration


def _duration(seconds: float) -> str:
    """Return a time span in words, such as '1:00:00 (h:mm:ss)'."""
    return f'{timedelta(seconds=round(seconds))} (h:mm:ss)'
