"""A running graph for tests: real processes over real DDS, and a listener to their messages."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from patience import LOOK_EACH_S, PATIENCE_S
from rclpy.context import Context
from rclpy.node import Node

from porotwin_core.ros import qos
from porotwin_core.ros.node import DIAGNOSTICS, HEARD_BY
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.vouching import Voucher
from porotwin_hub.launching.graph import NAMESPACE, NodeDescription
from porotwin_hub.launching.processes import GraphProcesses
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    NewState,
    Setpoint,
    StateRefreshed,
    TracerField,
)

TOPICS: dict[str, tuple[Any, Any]] = {
    'asset/new_state': (NewState, qos.FIELD),
    'asset/state_refreshed': (StateRefreshed, qos.FIELD),
    'asset/clean_state': (CleanState, qos.FIELD),
    'tracer/predicted': (TracerField, qos.FIELD),
    'wells/setpoint': (Setpoint, qos.SETPOINT),
    'hub/cycle': (CycleReport, qos.FIELD),
    DIAGNOSTICS: (DiagnosticArray, 10),
}


class Listener:
    """Keeps every message of `TOPICS`; its `node` may be used to call services."""

    def __init__(self, domain: int, namespace: str = NAMESPACE) -> None:
        """Listen in the DDS domain `domain`."""
        self.messages: dict[str, list[Any]] = {name: [] for name in TOPICS}
        self._changed = threading.Condition()
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        self.node = rclpy.create_node('listener', namespace=namespace, context=context)
        for name, (message_type, profile) in TOPICS.items():
            self.node.create_subscription(message_type, name, self._keep(name), profile)
        self._thread = NodeThread(self.node)
        self._callers: dict[tuple[str, str], tuple[Any, Voucher]] = {}

    def _keep(self, name: str) -> Callable[[Any], None]:
        def keep(message: Any) -> None:
            with self._changed:
                self.messages[name].append(message)
                self._changed.notify_all()

        return keep

    def wait_for(
        self, purpose: str, condition: Callable[[], bool], *, timeout: float = PATIENCE_S
    ) -> None:
        """Return when `condition` holds; fail after `timeout` [s] with the `purpose`."""
        with self._changed:
            deadline = time.monotonic() + timeout
            while not condition():
                counts = {name: len(messages) for name, messages in self.messages.items()}
                assert time.monotonic() < deadline, (
                    f'waited {timeout:g} s for {purpose}; received {counts}'
                )
                self._changed.wait(LOOK_EACH_S)

    def spin(self, node: Node) -> None:
        """Call the callbacks of `node`, of the same context, until the end."""
        self._thread.executor.add_node(node)

    def answer(self, caller: str, kind: Any, name: str, request: Any) -> Any:
        """Return the answer to the node `caller`, which vouches."""
        if (caller, name) not in self._callers:
            node = rclpy.create_node(
                caller, namespace=self.node.get_namespace(), context=self.node.context
            )
            self.spin(node)
            # it stays: an ended client is seen for a moment, and two of a name are refused
            self._callers[caller, name] = node.create_client(kind, name), Voucher(node)
        client, voucher = self._callers[caller, name]
        assert client.wait_for_service(PATIENCE_S), name
        voucher.vouch(name, request)
        future = client.call_async(request)
        self.wait_for(f'an answer of {name}', future.done)
        return future.result()

    def close(self) -> None:
        """Stop listening."""
        self._thread.end()


class RunningGraph:
    """The processes of the `nodes`, their messages by topic, and the `lines` of the supervisor."""

    def __init__(
        self, nodes: list[str], processes: GraphProcesses, listener: Listener, lines: list[str]
    ) -> None:
        self.nodes = nodes
        self.processes = processes
        self.listener = listener
        self.lines = lines
        self.messages = listener.messages

    def log(self, name: str) -> str:
        """Return the log of a node so far."""
        path = self.processes.log(name)
        return path.read_text(encoding='utf-8', errors='replace') if path.is_file() else ''

    @contextmanager
    def logs_of_a_failure(self) -> Iterator[None]:
        """Print the ends of all logs if the block fails."""
        try:
            yield
        except BaseException:
            for name in self.nodes:
                print(f'--- {name}\n{self.log(name)[-2000:]}')
            raise

    def wait_until_heard(self, name: str) -> None:
        """Return when a node tells that it knows the listener, so that no state is missed."""

        def heard() -> bool:
            return any(
                value.key == HEARD_BY and 'listener' in value.value.split()
                for array in self.messages[DIAGNOSTICS]
                for status in array.status
                for value in status.values
                if status.name == name
            )

        self.listener.wait_for(f'{name} to know the listener', heard)

    def wait_for_messages(
        self, topic: str, count: int, *, timeout: float = PATIENCE_S
    ) -> list[Any]:
        """Return the messages of `topic` when there are `count`, after at most `timeout` [s]."""
        self.listener.wait_for(
            f'{count} messages on {topic}',
            lambda: len(self.messages[topic]) >= count,
            timeout=timeout,
        )
        return self.messages[topic]

    def wait_for_log(self, name: str, text: str, *, timeout: float = PATIENCE_S) -> str:
        """Return the first line of a node's log with `text`, after at most `timeout` [s]."""
        found: list[str] = []

        def there() -> bool:
            found[:] = [line for line in self.log(name).splitlines() if text in line]
            return bool(found)

        self.listener.wait_for(f"'{text}' in the log of {name}", there, timeout=timeout)
        return found[0]


@contextmanager
def running_graph(
    nodes: list[NodeDescription],
    folder: Path,
    domain: int,
    more: Mapping[str, str] | None = None,
) -> Iterator[RunningGraph]:
    """Start `nodes` in a DDS domain of their own; print their logs when the test fails.

    `more` are other variables of their environment.
    """
    lines: list[str] = []
    environment = {'ROS_DOMAIN_ID': str(domain), **(more or {})}
    listener = Listener(domain, nodes[0].namespace)
    try:
        with GraphProcesses(nodes, folder, say=lines.append, environment=environment) as processes:
            graph = RunningGraph([node.name for node in nodes], processes, listener, lines)
            with graph.logs_of_a_failure():
                yield graph
    finally:
        listener.close()
