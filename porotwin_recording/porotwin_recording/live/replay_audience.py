"""The graph that a replay plays into, as its player sees it: who runs, and who listens."""

import time
from collections.abc import Callable, Iterable, Sequence, Set
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from porotwin_core.ros.node import DIAGNOSTICS, HEARD_BY, TwinNode, hardware_id
from porotwin_core.ros.senders import LONGEST_SEARCH_S
from porotwin_recording.live.replay_readiness import HUB, RECORDER, GraphSeen, PlayedTopic
from porotwin_recording.live.replay_topics import QUEUE_DEPTH
from porotwin_recording.mcap import topic_names
from porotwin_recording.mcap.interfaces import message_class


class ReplayAudience:
    """What the player `node` knows of the graph.

    Args:
        node: the player.
        lockstep: absolute topic of the answers that the replay waits for; empty: none.
        on_answer: gets every answer, serialised.
        on_status: gets the diagnostics of all nodes of the twin, in lock-step.
    """

    def __init__(
        self,
        node: TwinNode,
        lockstep: str,
        on_answer: Callable[[bytes], None],
        on_status: Callable[[DiagnosticStatus, dict[str, str]], None],
    ) -> None:
        """Begin to listen."""
        self._node, self._lockstep = node, lockstep
        self._on_answer, self._on_status = on_answer, on_status
        self._deaf = self._connections_needed()
        self._answer_subscription: Subscription | None = None
        self._asking: dict[str, AsyncParameterClient] = {}
        self._asked: dict[str, Any] = {}
        self._ask_again: dict[str, float] = {}

    def _connections_needed(self) -> set[tuple[str, str]]:
        """Return the senders and receivers of the twin that a photograph's answer passes through.

        The player sees that both run, but not whether they have found each other.
        """
        if not self._lockstep:
            return set()
        self._node.create_subscription(
            DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, QUEUE_DEPTH
        )
        answers = self._lockstep == self._node.resolve_topic_name(topic_names.CYCLE)
        return {('imaging', HUB), *([(HUB, self._node.get_name())] if answers else [])}

    def seen(self, publishers: Sequence[Publisher]) -> GraphSeen:
        """Return the graph as it is now, for the `publishers` of the topics to play."""
        space = self._node.get_namespace()
        nodes = frozenset(
            name
            for name, namespace in self._node.get_node_names_and_namespaces()
            if namespace == space and name != self._node.get_name()
        )
        topics = tuple(
            PlayedTopic(
                publisher.topic_name,
                publisher.get_subscription_count(),
                tuple(
                    sorted(
                        info.node_name
                        for info in self._node.get_subscriptions_info_by_topic(publisher.topic_name)
                    )
                ),
            )
            for publisher in publishers
        )
        services = frozenset(
            name.removeprefix(f'{space}/')
            for name, _ in self._node.get_service_names_and_types()
            if name.startswith(f'{space}/')
        )
        told = self._told(HUB, nodes, ['use_sim_time', 'rig'])
        simulated = None if told is None else bool(told[0].bool_value)
        return GraphSeen(
            nodes,
            topics,
            services,
            self._recorded(nodes),
            self._hears_answers(),
            simulated,
            tuple(sorted(self._deaf)),
        )

    def found(self) -> str:
        """Return the graph that the player sees: its namespace, and the rig of its hub."""
        told = self._told(HUB, (), [])
        rig = told[1].string_value if told is not None else ''
        return f'the graph {self._node.get_namespace()}' + (f' of the rig {rig}' if rig else '')

    def _recorded(self, nodes: Set[str]) -> frozenset[str] | None:
        """Return the topics that the node `recorder` takes; None: all, or it has not answered."""
        told = self._told(RECORDER, nodes, ['topics'])
        if told is None:
            return None
        (value,) = told
        names = value.string_value.split()
        return frozenset(self._node.resolve_topic_name(name) for name in names) if names else None

    def _told(self, name: str, nodes: Iterable[str], parameters: list[str]) -> list[Any] | None:
        """Return the values of parameters of one of the `nodes`; None: it has not answered yet.

        A node may lose its first answers, because it discovers this one later. It is asked again.
        """
        asked = self._asked.get(name)
        waits = asked is None or not asked.done()
        if waits and name in nodes and time.monotonic() >= self._ask_again.get(name, 0.0):
            if name not in self._asking:
                self._asking[name] = AsyncParameterClient(self._node, name)
            client = self._asking[name]
            if client.services_are_ready():
                self._asked[name] = asked = client.get_parameters(parameters)
                self._ask_again[name] = time.monotonic() + LONGEST_SEARCH_S
        if asked is None or not asked.done():
            return None
        values: list[Any] = asked.result().values
        return values if len(values) else None

    def _hears_answers(self) -> bool | None:
        """Return whether the answering node is connected; None without lock-step.

        The running graph knows the type of the answers, so the subscription waits for it.
        """
        if not self._lockstep:
            return None
        if self._answer_subscription is None:
            types = dict(self._node.get_topic_names_and_types()).get(self._lockstep, [])
            if not types or not self._node.count_publishers(self._lockstep):
                return False
            self._answer_subscription = self._node.create_subscription(
                message_class(types[0]), self._lockstep, self._on_answer, QUEUE_DEPTH, raw=True
            )
        return bool(self._answer_subscription.get_publisher_count() > 0)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Take note of connections, and hand on every status."""
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.hardware_id == hardware_id(self._node):
                hearers = values.get(HEARD_BY, '').split()
                self._deaf -= {(status.name, hearer) for hearer in hearers}
            self._on_status(status, values)
