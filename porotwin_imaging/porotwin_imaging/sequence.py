"""The order of states: which photograph follows the last, and when the sequence is interrupted.

A photograph that comes late, between those already read, is left out. A clock that was set back
shows as photographs that all lie before the last one; a gap means that photographs were missed. In
both cases the next state does not follow from the last and a new sequence of time begins. Before
the first baseline photographs wait.
"""

import statistics
from collections import deque
from dataclasses import dataclass
from typing import Literal

GAP = 2.5
"""Intervals between two photographs, in the usual ones, from which photographs are missing."""
REMEMBERED = 16
MEND = (
    'take a photograph without tracer, and name it in imaging.csv with role baseline or start the '
    'camera with it'
)
_SAME = 1e-6
"""Stamps closer than this are the same exposure [s]."""


@dataclass(frozen=True)
class Verdict:
    """What becomes of a photograph.

    `next`: it follows the last state by `time_step` [s]; `start`: it begins a sequence of time;
    `ignore`: it is left out. `reason` is one line where there is something to say.
    """

    action: Literal['next', 'start', 'ignore']
    time_step: float = 0.0
    reason: str = ''


class Waiting:
    """Photographs that wait for a baseline, the newest `room` of them."""

    def __init__(self, room: int) -> None:
        self._photos: deque[tuple[float, bytes]] = deque(maxlen=room)
        self._told = ''

    def add(self, time: float, data: bytes) -> str:
        """Keep the photograph exposed at `time` [s]; return one line where it has not been said."""
        full = len(self._photos) == self._photos.maxlen
        self._photos.append((time, data))
        fate = 'the oldest that wait for one are left out' if full else 'photographs wait for one'
        if fate == self._told:
            return ''
        self._told = fate
        return f'no baseline yet, {fate}: {MEND}'

    def release(self) -> list[tuple[float, bytes]]:
        """Return time and content of all, which wait no longer."""
        photos = list(self._photos)
        self._photos.clear()
        self._told = ''
        return photos


class StateSequence:
    """Judges photographs by exposure time and content; `longest_gap` [s], None: from the pace."""

    def __init__(self, longest_gap: float | None = None) -> None:
        self._longest_gap = longest_gap
        self._times: deque[float] = deque(maxlen=REMEMBERED)
        self._digests: deque[str] = deque(maxlen=REMEMBERED)
        self._set_back: float | None = None

    def restart(self) -> None:
        """Forget all times: the next photograph starts a sequence."""
        self._times.clear()
        self._digests.clear()
        self._set_back = None

    def judge(self, time: float, digest: str) -> Verdict:
        """Return what becomes of the photograph exposed at `time` [s] with content `digest`."""
        if digest in self._digests:
            return Verdict('ignore', reason=f'photograph at {time:.3f} s is a duplicate')
        if not self._times:
            return Verdict('start', reason='first photograph')
        last = self._times[-1]
        if abs(time - last) < _SAME:
            return Verdict('ignore', reason=f'second photograph stamped {time:.3f} s')
        if time < last:
            return self._judge_earlier(time, last)
        gap = self._gap()
        if gap is not None and time - last > gap:
            return Verdict(
                'start', reason=f'{time - last:.0f} s without a photograph: some are missing'
            )
        return Verdict('next', time - last)

    def accept(self, time: float, digest: str, verdict: Verdict) -> None:
        """Note that the photograph became a state."""
        if verdict.action == 'start':
            self._times.clear()
        self._times.append(time)
        self._digests.append(digest)
        self._set_back = None

    def _judge_earlier(self, time: float, last: float) -> Verdict:
        repeated = self._set_back is not None and self._set_back < time
        if time < self._times[0] - _SAME or repeated:
            return Verdict('start', reason=f'the clock went back from {last:.3f} s to {time:.3f} s')
        self._set_back = time
        return Verdict(
            'ignore', reason=f'photograph at {time:.3f} s is out of order: {last:.3f} s was read'
        )

    def _gap(self) -> float | None:
        if self._longest_gap is not None:
            return self._longest_gap
        steps = [b - a for a, b in zip(self._times, list(self._times)[1:], strict=False)]
        return GAP * statistics.median(steps) if steps else None
