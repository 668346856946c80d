"""The clock policy of the camera: which time a photograph gets.

A photograph has up to four times: EXIF, the protocol `imaging.csv`, the file and its arrival. The
first believable one, in this order, becomes its stamp. `docs/camera.md` gives the reasons.

- A time is believable if it lies between `EARLIEST_S` and the arrival.
- A photograph without a believable time gets its arrival, but only if it arrived while the source
  watched and at the pace of a camera. Otherwise it may be old, and gets an old time.
- A camera's clock that is late by the same amount in `AGREEING` fresh photographs in a row is
  wrong. Its times are corrected from then on.
- Stamps strictly increase. A photograph that is older than the last one is left out.

The functions are pure: the memory of the clock is an argument and a result.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import pairwise
from statistics import median
from typing import Literal

from porotwin_core.clock.photo_interval import LONGEST_GAP_S
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.clock.time_units import DAYS

Trust = Literal['exif', 'file', 'arrival']
"""The first time that may be believed: all, all but EXIF, or the arrival alone."""

EARLIEST_S = datetime(2015, 1, 1, tzinfo=UTC).timestamp()
"""Earlier times [s since 1970] come from a clock that was reset: no rig is as old."""
JITTER_S = 3.0
"""Times that differ by less agree [s]: clocks set over a network do so, EXIF counts whole seconds,
and writing takes time. A time farther before the last stamp is an older photograph."""
OLD_INTERVALS = 10.0
"""Photographs that may be old get times before the arrival by this multiple of the interval. A
setpoint lasts three intervals, so that nobody acts on them."""
AGREEING = 3
"""Fresh photographs in a row that must agree on the error of the camera's clock. One or two may be
old files that somebody copied. So many arrivals within half an interval are of no camera."""

START_IS_WRONG = (
    'Pauses and end of the experiment still count from the first photograph: set the clock, and '
    'start the twin again'
)
"""Said after a correction of less than a week."""


@dataclass(frozen=True)
class TimeEvidence:
    """The times of one photograph [s since 1970], None where unknown.

    Attributes:
        name: name for messages.
        arrival: this computer's clock when the photograph was first seen.
        exif: exposure time that the camera wrote.
        protocol: time from `imaging.csv`, perhaps counted from the start of an experiment.
        protocol_end: largest time of the protocol.
        file: time of the last change of the file.
        watched: True if the photograph arrived while the source looked for new ones.
        waiting: number of photographs that wait behind this one.
        in_sequence: False for a baseline, which may be older than the photographs before it.
    """

    name: str
    arrival: float
    exif: float | None = None
    protocol: float | None = None
    protocol_end: float = 0.0
    file: float | None = None
    watched: bool = True
    waiting: int = 0
    in_sequence: bool = True


@dataclass(frozen=True)
class ClockMemory:
    """The memory of the clock.

    Attributes:
        last: the last stamp [s]; None before the first.
        correction: to add to EXIF times [s].
        arrivals: arrivals of the last photographs [s].
        lags: arrival minus EXIF time of the last photographs, if they were fresh [s].
        said: kinds of remarks that were made.
    """

    last: float | None = None
    correction: float = 0.0
    arrivals: tuple[float, ...] = ()
    lags: tuple[float, ...] = ()
    said: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Stamp:
    """The time of a photograph.

    Attributes:
        time: the stamp [s since 1970]; None if the photograph must be left out.
        remarks: one line each.
    """

    time: float | None
    remarks: tuple[str, ...] = ()


def believable(time: float | None, arrival: float) -> bool:
    """Return whether a photograph that arrived at `arrival` may be of `time` [s since 1970]."""
    return time is not None and math.isfinite(time) and EARLIEST_S <= time <= arrival + JITTER_S


def own_time(evidence: TimeEvidence, trust: Trust = 'exif') -> float | None:
    """Return the first believable time of a photograph before its arrival [s], None if none is.

    It gives the order of photographs that wait.
    """
    times = _times(_anchored(evidence, 0.0), trust)
    return next((time for _, time in times if believable(time, evidence.arrival)), None)


def stamps(
    batch: Sequence[TimeEvidence],
    memory: ClockMemory,
    *,
    interval_s: float,
    trust: Trust = 'exif',
) -> tuple[list[Stamp], ClockMemory]:
    """Return the stamps of photographs that became ready together, and the new memory.

    Args:
        batch: the photographs in the order of the sequence.
        memory: the memory after the photographs before them.
        interval_s: usual time between photographs [s].
        trust: the first time that may be believed.
    """
    copied = _is_copied(batch, interval_s)
    found = []
    for evidence in batch:
        live = evidence.watched and not _is_burst(batch, evidence, memory, interval_s)
        seen = replace(evidence, file=None) if copied and not live else evidence
        stamp, memory = _stamp(seen, memory, live=live, interval_s=interval_s, trust=trust)
        found.append(stamp)
    return found, memory


def _times(evidence: TimeEvidence, trust: Trust) -> list[tuple[str, float | None]]:
    """Return names and values of the times that `trust` allows, in the order of belief."""
    exif = [('EXIF time', evidence.exif)] if trust == 'exif' else []
    others = [('protocol time', evidence.protocol), ('file time', evidence.file)]
    return [*exif, *(others if trust != 'arrival' or not evidence.watched else [])]


def _anchored(evidence: TimeEvidence, before_s: float) -> TimeEvidence:
    """Return the evidence with a protocol that counts from 1970, so that its times can be compared.

    The last time of a protocol that counts from the start of an experiment lies `before_s` [s]
    before the arrival. That says nothing of a photograph that has just been taken.
    """
    if evidence.protocol is None or evidence.protocol >= EARLIEST_S:
        return evidence
    if evidence.watched:
        return replace(evidence, protocol=None)
    to_end = evidence.protocol_end - evidence.protocol
    return replace(evidence, protocol=evidence.arrival - before_s - max(to_end, 0.0))


def _is_copied(batch: Sequence[TimeEvidence], interval_s: float) -> bool:
    """Return whether the file times are closer than photographs of a camera: a copied folder."""
    files = sorted(evidence.file for evidence in batch if evidence.file is not None)
    steps = [later - earlier for earlier, later in pairwise(files)]
    return bool(steps) and median(steps) < interval_s / 4


def _is_burst(
    batch: Sequence[TimeEvidence], evidence: TimeEvidence, memory: ClockMemory, interval_s: float
) -> bool:
    """Return whether too many photographs arrived together for a camera."""
    arrivals = [*memory.arrivals, *(other.arrival for other in batch)]
    return sum(abs(one - evidence.arrival) <= interval_s / 2 for one in arrivals) >= AGREEING


def _stamp(
    evidence: TimeEvidence,
    memory: ClockMemory,
    *,
    live: bool,
    interval_s: float,
    trust: Trust,
) -> tuple[Stamp, ClockMemory]:
    """Return the stamp of one photograph and the new memory."""
    remarks: list[tuple[str, str]] = []
    if memory.last is not None and memory.last > evidence.arrival + JITTER_S:
        back = memory.last - evidence.arrival
        line = f"this computer's clock was set back by {back:.0f} s: times begin anew"
        remarks.append((f'set {back:.0f}', line))
        memory = replace(memory, last=None, lags=(), arrivals=())
    if live:
        memory, remark = _with_lag(evidence, memory, interval_s)
        remarks += remark
    exif = None if evidence.exif is None else evidence.exif + memory.correction
    anchored = _anchored(replace(evidence, exif=exif), OLD_INTERVALS * interval_s)
    time, doubts = _believed(anchored, trust)
    remarks += doubts
    if time is None:
        time = evidence.arrival if live else _old_time(evidence, memory, interval_s)
    lines = tuple(line for kind, line in remarks if kind not in memory.said)
    memory = replace(
        memory,
        said=memory.said | {kind for kind, _ in remarks},
        arrivals=(*memory.arrivals, evidence.arrival)[-AGREEING:],
    )
    if time is None:
        reason = (
            f"photograph '{evidence.name}' left out: it has no believable time and did not come at "
            f'the pace of a camera that takes one per {interval_s:g} s'
        )
        return Stamp(None, (*lines, reason)), memory
    if not evidence.in_sequence:
        return Stamp(time, lines), memory
    if memory.last is not None and time < memory.last - JITTER_S:
        why = 'it is out of order'
        if live and memory.lags:  # a fresh file
            why = (
                f"the camera's clock was set back; after {AGREEING} photographs of this clock its "
                'times are corrected'
            )
        older = f'{memory.last - time:.0f} s older than the last one, so {why}'
        reason = f"photograph '{evidence.name}' left out: it is {older}"
        return Stamp(None, (*lines, reason)), memory
    if memory.last is not None:
        time = max(time, memory.last + 2.0 * SAME_STAMP_S)
    return Stamp(time, lines), replace(memory, last=time)


def _believed(evidence: TimeEvidence, trust: Trust) -> tuple[float | None, list[tuple[str, str]]]:
    """Return the first believable time [s], and remarks about those before it, with their kinds."""
    remarks: list[tuple[str, str]] = []
    for kind, time in _times(evidence, trust):
        if believable(time, evidence.arrival):
            return time, remarks
        if time is not None:
            line = (
                f"{kind} {_date(time)} of '{evidence.name}' is not believed: set the clock that "
                'wrote it. Until then the next best time counts, at last the arrival'
            )
            remarks.append((kind, line))
    return None, remarks


def _old_time(evidence: TimeEvidence, memory: ClockMemory, interval_s: float) -> float | None:
    """Return a time [s] that nobody acts on, None if the photographs before it are not old."""
    latest = evidence.arrival - OLD_INTERVALS * interval_s
    if memory.last is None:
        return latest - evidence.waiting * interval_s
    if memory.last >= latest:
        return None
    return min(memory.last + interval_s / 2, latest)


def _with_lag(
    evidence: TimeEvidence, memory: ClockMemory, interval_s: float
) -> tuple[ClockMemory, list[tuple[str, str]]]:
    """Return the memory with the lag of a photograph, corrected if the lags agree, and remarks."""
    alone = not memory.arrivals or evidence.arrival - memory.arrivals[-1] >= interval_s / 2
    fresh = evidence.file is not None and abs(evidence.arrival - evidence.file) <= interval_s / 2
    if evidence.exif is None or evidence.exif < 0 or not (alone and fresh):
        return replace(memory, lags=()), []
    lags = (*memory.lags, evidence.arrival - evidence.exif)[-AGREEING:]
    memory = replace(memory, lags=lags)
    agree = len(lags) == AGREEING and max(lags) - min(lags) <= JITTER_S
    wanted = 0.0 if abs(median(lags)) <= interval_s else min(lags)
    if not agree or abs(wanted - memory.correction) <= JITTER_S:
        return memory, []
    relation = 'behind' if wanted > 0 else 'ahead of'
    days = f' ({DAYS.text(abs(wanted))})' if abs(wanted) > DAYS.seconds else ''
    # after a longer step another experiment begins by itself
    start = '' if abs(wanted) > LONGEST_GAP_S else '. ' + START_IS_WRONG
    line = (
        f"the camera's clock is {abs(wanted):.0f} s{days} {relation} this computer's clock: its "
        f'times are corrected{start}'
        if wanted
        else "the camera's clock agrees with this computer's clock again"
    )
    return replace(memory, correction=wanted), [(f'correction {wanted:.0f}', line)]


def _date(time: float) -> str:
    """Return a time [s since 1970] as a date in UTC for messages."""
    try:
        return datetime.fromtimestamp(time, UTC).strftime('%Y-%m-%d %H:%M:%S UTC')
    except (ValueError, OverflowError, OSError):
        return f'{time:g} s'
