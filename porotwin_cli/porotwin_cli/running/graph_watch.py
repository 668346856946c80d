"""Watches a running graph: reports of the hub, setpoints, and the end of the experiment."""

import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import Self

from porotwin_cli.running.live_node import listening, live_node
from porotwin_core.ros import qos
from porotwin_core.ros.following import follow
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_msgs.msg import CleanState, CycleReport, Setpoint


class GraphWatch:
    """Calls `on_cycle` for every report, in a thread of its own; a context manager.

    The event `finished` is set when the asset ends the experiment.
    """

    def __init__(
        self,
        on_cycle: Callable[[CycleReport], None],
        *,
        on_setpoint: Callable[[Setpoint], None] | None = None,
    ) -> None:
        """Prepare to watch.

        Args:
            on_cycle: is called with each report of the hub.
            on_setpoint: is called with each setpoint; None: setpoints are not watched.
        """
        self.finished = threading.Event()
        self._on_cycle = on_cycle
        self._on_setpoint = on_setpoint
        self._listening = ExitStack()

    def __enter__(self) -> Self:
        node = live_node('watch', namespace=NAMESPACE)
        follow(node, CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        follow(node, CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        if self._on_setpoint is not None:
            follow(node, Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT)
        self._listening.enter_context(listening(node))
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.close()

    def _on_clean(self, message: CleanState) -> None:
        if message.cause == CleanState.FINISHED:
            self.finished.set()
