"""Where what arrives meets what is shown: one snapshot, replaced as a whole."""

import threading
from collections.abc import Callable
from typing import Any

from porotwin_page.snapshot import Snapshot


class Board:
    """Holds the newest snapshot; written by callbacks of the graph, read by the server."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._snapshot = Snapshot()
        self._revision = 0

    def apply(self, step: Callable[..., Snapshot], *arguments: Any, **named: Any) -> None:
        """Replace the snapshot by `step(snapshot, *arguments, **named)`."""
        with self._lock:
            self._snapshot = step(self._snapshot, *arguments, **named)
            self._revision += 1

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot."""
        return self._snapshot

    @property
    def revision(self) -> int:
        """Counts the changes; the same number means the same snapshot."""
        return self._revision
