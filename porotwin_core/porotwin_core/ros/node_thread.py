"""Spins nodes in a thread of its own, beside the work of a command or a test."""

import threading

from rclpy.node import Node
from rclpy.task import Future

from porotwin_core.clock.periods import END_S
from porotwin_core.ros.node import end_in_order, executor_of, kept_awake, until_shutdown


class NodeThread:
    """Calls the callbacks of nodes of one context until `end`."""

    def __init__(self, *nodes: Node, threads: int = 1) -> None:
        """Start the thread.

        Args:
            nodes: at least one node; `executor.add_node` takes more of the same context.
            threads: number of threads that run callbacks.
        """
        self.executor = executor_of(threads, nodes[0].context)
        for node in nodes:
            self.executor.add_node(node)
        self._ended: Future = Future()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        with until_shutdown(self.executor.context), kept_awake(self.executor):
            self.executor.spin_until_future_complete(self._ended)

    def end(self) -> None:
        """End the thread, then the nodes, then their context."""
        self._ended.set_result(None)
        self._thread.join(END_S)
        end_in_order(self.executor, self.executor.get_nodes(), self.executor.context)
