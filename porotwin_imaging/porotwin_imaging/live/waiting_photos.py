"""Photographs that arrive before the baseline and wait for it."""

from collections import deque

REMEDY = (
    'take a photograph without tracer, and name it in imaging.csv with role baseline or start the '
    'camera with it'
)


class WaitingPhotos:
    """Keeps the newest `room` photographs."""

    def __init__(self, room: int) -> None:
        self._photos: deque[tuple[float, bytes]] = deque(maxlen=room)
        self._last_warning = ''

    def add(self, time: float, data: bytes) -> str:
        """Keep the photograph exposed at `time` [s]; return a warning, empty if it is repeated."""
        full = len(self._photos) == self._photos.maxlen
        self._photos.append((time, data))
        effect = 'the oldest that wait for one are left out' if full else 'photographs wait for one'
        if effect == self._last_warning:
            return ''
        self._last_warning = effect
        return f'no baseline yet, {effect}: {REMEDY}'

    def release(self) -> list[tuple[float, bytes]]:
        """Return time [s] and bytes of all photographs and forget them."""
        photos = list(self._photos)
        self._photos.clear()
        self._last_warning = ''
        return photos
