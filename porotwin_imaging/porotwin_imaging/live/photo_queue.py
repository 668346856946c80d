"""Photographs that have arrived and wait until the ones before them are read."""

import threading
from collections import deque
from typing import NamedTuple

from porotwin_core.basis.remark import Remark
from porotwin_core.clock.stamps import time_in_words


class QueuedPhoto(NamedTuple):
    """A photograph: `role` 'baseline' or 'state', exposure `time` [s], bytes of the file."""

    role: str
    time: float
    data: bytes


class PhotoQueue:
    """Keeps all baselines and at most `room` state photographs; one thread puts, another gets."""

    def __init__(self, room: int) -> None:
        """Begin empty."""
        self._room = room
        self._photos: deque[QueuedPhoto] = deque()
        self._changed = threading.Condition()

    def put(self, photo: QueuedPhoto) -> Remark | None:
        """Add a photograph; return the remark on those that were left out for it; None if none.

        Without room the older half is left out, so that the remark does not come with each one.
        """
        with self._changed:
            self._photos.append(photo)
            self._changed.notify()
            states = [each for each in self._photos if each.role == 'state']
            if len(states) <= self._room:
                return None
            gone = states[: len(states) // 2]
            leave = {id(each) for each in gone}
            self._photos = deque(each for each in self._photos if id(each) not in leave)
        return Remark.of(
            'photographs',
            'left_out',
            '{count} from {first} to {last} left out: they come faster than they are read; take '
            'fewer, or replay with --lock-step',
            count=len(gone),
            first=time_in_words(gone[0].time),
            last=time_in_words(gone[-1].time),
        )

    def get(self) -> QueuedPhoto:
        """Wait for a photograph and return the oldest one."""
        with self._changed:
            self._changed.wait_for(lambda: self._photos)
            return self._photos.popleft()
