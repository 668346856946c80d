"""Shares the newest snapshot between the graph's callbacks and the server's threads."""

import threading
from collections.abc import Callable
from typing import Any

from porotwin_page.graph_snapshot import GraphSnapshot


class SnapshotStore:
    """Holds the newest snapshot. Writers replace it as a whole, so readers need no lock."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._snapshot = GraphSnapshot()
        self._revision = 0

    def update(self, step: Callable[..., GraphSnapshot], *arguments: Any, **named: Any) -> None:
        """Replace the snapshot by the result of `step(snapshot, *arguments, **named)`."""
        with self._lock:
            self._snapshot = step(self._snapshot, *arguments, **named)
            self._revision += 1

    @property
    def snapshot(self) -> GraphSnapshot:
        """The newest snapshot."""
        return self._snapshot

    @property
    def revision(self) -> int:
        """Number of changes so far; equal numbers mean equal snapshots."""
        return self._revision
