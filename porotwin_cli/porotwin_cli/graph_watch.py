"""Watches a running graph: reports of the hub, setpoints, and the end of the experiment."""

import threading
from collections.abc import Callable
from typing import Self

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from porotwin_core import qos
from porotwin_core.node import END_S, until_shutdown
from porotwin_hub.graph import NAMESPACE
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
        self._context = Context()

    def __enter__(self) -> Self:
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('watch', namespace=NAMESPACE, context=self._context)
        self._node.create_subscription(CycleReport, 'hub/cycle', self._on_cycle, qos.FIELD)
        self._node.create_subscription(CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        if self._on_setpoint is not None:
            self._node.create_subscription(
                Setpoint, 'wells/setpoint', self._on_setpoint, qos.SETPOINT
            )
        self._spinning = threading.Thread(target=self._spin, daemon=True)
        self._spinning.start()
        return self

    def __exit__(self, *_: object) -> None:
        rclpy.try_shutdown(context=self._context)
        self._spinning.join(END_S)
        self._node.destroy_node()

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        with until_shutdown(self._context):
            executor.spin()

    def _on_clean(self, message: CleanState) -> None:
        if message.cause == CleanState.FINISHED:
            self.finished.set()
