"""The senders of messages: the nodes that publish a topic, call a service or offer one.

ROS 2 Jazzy does not tell which node sent a message. It tells which nodes could have sent it. A
receiver that accepts one sender therefore refuses all messages while another node could send. A
writer of another type cannot: the middleware connects endpoints of one type only.
"""

import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from porotwin_core.basis.errors import InputError

GUARD = 'guard'
"""Name of the node that alone may set the pumps."""

TERMINAL = 'terminal'
"""Name of the node of a command by which a person acts on the running twin."""

PLAYER = 'player'
"""Name of the node that plays a recording: it sends the messages of all nodes."""


def vouched_by(name: str) -> str:
    """Return the hidden topic on which the node `name` tells its requests; see `vouching`."""
    return f'{name}/_vouched'


CAMERAS = ('camera', 'mock_camera', 'virtual_rig')
"""Names of the nodes that send photographs; a camera node of somebody else is given the first."""

SENDERS: Mapping[str, tuple[str, ...]] = {
    '/clock': ('virtual_rig', 'mock_camera'),
    'camera/baseline/compressed': CAMERAS,
    'camera/image/compressed': CAMERAS,
    'asset/clean_state': ('imaging', 'virtual_rig'),
    'asset/experiment': ('imaging',),
    'asset/new_state': ('imaging',),
    'asset/state_refreshed': ('imaging',),
    'hub/cycle': ('hub',),
    'mend/offer': ('mend',),
    'mend/seen': ('mend',),
    'model/effects': ('solver',),
    'rig/description': ('hub',),
    'siblings/forecast': ('siblings',),
    'tracer/corrected': ('hub',),
    'tracer/predicted': ('hub',),
    'wells/measured': ('operator', 'pumps', 'virtual_rig'),
    'wells/setpoint': (GUARD,),
    **{vouched_by(name): (name,) for name in ('guard', 'hub', 'mend', 'page', TERMINAL, 'trainer')},
}
"""The only nodes that send each topic. `following` subscribes to these topics, and nothing else
that uses them does. Any node may send its health."""

ASSET = 'asset'
"""Begin of the names of the services of the pumps."""

UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'
"""Name of a node that was discovered a moment ago, or of a program that is no ROS node."""

LONGEST_SEARCH_S = 2.0
"""Longest wait for a service, or the name of a node, to appear [s]: discovery takes less, and a
setpoint is due."""

LEASE_S = 20.0
"""Fast DDS forgets a killed process after this time [s], its default."""

NAME_PERIOD_S = 0.05
"""Time between two looks for that name [s]."""

_nameless: set[str] = set()
"""Identities of senders whose name never came: a flood of theirs must not be waited for again."""


@dataclass(frozen=True, order=True)
class Sender:
    """A writer in the graph: its node's full name, and an identity that no other writer has."""

    node: str
    identity: str


def full_name(node: Any, name: str) -> str:
    """Return the full name of the node `name` in the namespace of `node`."""
    return f'{node.get_namespace().rstrip("/")}/{name}'


def sender_name(info: Any) -> str:
    """Return the full name of the node of an endpoint (rclpy.topic_endpoint_info)."""
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'


def is_simulated(node: Any) -> bool:
    """Return whether `node` was started for simulated time, as in a replay."""
    return bool(node.get_parameter('use_sim_time').value)


def may_send(node: Any, topic: str, *, replayed: bool | None = None) -> frozenset[str]:
    """Return the full names of the nodes that may publish `topic`, as in `check_senders`."""
    replayed = is_simulated(node) if replayed is None else replayed
    names = (*SENDERS[topic], *((PLAYER,) if replayed else ()))
    return frozenset(full_name(node, name) for name in names)


def check_senders(node: Any, topic: str, *, replayed: bool | None = None) -> list[Sender]:
    """Return the publishers of `topic`, a name relative to `node`: only nodes of `SENDERS`.

    Args:
        node: the node that follows the topic.
        topic: a key of `SENDERS`.
        replayed: whether the player of a recording may publish it as well; None: in simulated time
            alone.

    Raises:
        InputError: another node does so too; one line with its name.
    """
    allowed, present = may_send(node, topic, replayed=replayed), publishers(node, topic)
    others = [sender for sender in present if sender.node not in allowed]
    refuse_others(node, others, SENDERS[topic], f'publishes {topic}')
    return present


def publishers(node: Any, topic: str) -> list[Sender]:
    """Return the publishers of `topic`, a name relative to `node` (rclpy.node.Node)."""
    return _named_senders(node, node.resolve_topic_name(topic), mangled=False)


def callers(node: Any, service: str) -> list[Sender]:
    """Return the clients of `service`, a name relative to `node` (rclpy.node.Node)."""
    # the DDS topic of the requests; the graph of ROS 2 Jazzy lists no clients of a service
    return _named_senders(node, f'rq{node.resolve_service_name(service)}Request', mangled=True)


def hearers(node: Any, *topics: str) -> frozenset[str]:
    """Return the names of the nodes that `node` knows to subscribe to all of `topics`.

    A message reaches only the subscribers that its sender knows, and each process gets to know the
    others on its own. What another node sees of the graph therefore proves nothing.
    """
    return frozenset.intersection(
        *(
            frozenset(
                info.node_name
                for info in node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic))
            )
            for topic in topics
        )
    )


def check_servers(node: Any, service: str) -> list[Sender]:
    """Return the servers of `service`, a name relative to `node`: only the node that may offer it.

    A node offers the services below its own name, and one node of the asset those of `asset`.
    A restarted server has a new identity. A killed server stays visible for `LEASE_S`. The service
    of the goals of an action stands for all services of that action.

    Raises:
        InputError: another node offers it too; one line with its name.
    """
    name, _, of_action = service.partition('/_action/')
    owner = name.split('/')[0]
    names = SENDERS['wells/measured'] if owner == ASSET else (owner,)
    parts = (goals_of, cancels_of, results_of) if of_action else ()
    found = []
    for one in [part(name) for part in parts] or [service]:
        # the DDS topic of the answers
        topic = f'rr{node.resolve_service_name(one)}Reply'
        found += _named_senders(node, topic, mangled=True)
    refuse_others(node, found, names, f'offers {name}')
    several = sorted({server.node for server in found})
    if len(several) > 1:
        raise InputError(f'several nodes offer {name} ({", ".join(several)}); end all but one')
    return found


def goals_of(action: str) -> str:
    """Return the service that takes the goals of `action`; ROS 2 makes it for every action."""
    return f'{action}/_action/send_goal'


def cancels_of(action: str) -> str:
    """Return the service that cancels goals of `action`; ROS 2 makes it for every action."""
    return f'{action}/_action/cancel_goal'


def results_of(action: str) -> str:
    """Return the service that gives results of `action`; ROS 2 makes it for every action."""
    return f'{action}/_action/get_result'


def refuse_others(node: Any, found: Collection[Sender], names: Sequence[str], doing: str) -> None:
    """Check that every sender in `found` is a node of one of the `names`.

    Args:
        node: the node that looks.
        found: from `publishers`, `callers` or `check_servers`.
        names: of the nodes that may.
        doing: the act in words, such as 'publishes wells/setpoint'.

    Raises:
        InputError: another node does so too; one line with its name.
    """
    allowed = {full_name(node, name) for name in names}
    others = sorted({sender.node for sender in found} - allowed)
    if others:
        name = others[0].replace(UNKNOWN_NODE, 'a program without a name')
        expected = full_name(node, ' or '.join(names))
        raise InputError(f'{name} {doing} too, and only {expected} may; end it')


def only(node: Any, found: Collection[Sender], names: Sequence[str], doing: str) -> list[Sender]:
    """Return `found`: at most one node of each of the `names`.

    Args:
        node: the node that looks.
        found: from `publishers` or `callers`.
        names: of the nodes that may.
        doing: the act in words, such as 'publishes wells/setpoint'.

    Raises:
        InputError: another node does so too, or there are several nodes of a name.
    """
    refuse_others(node, found, names, doing)
    for name, count in Counter(sender.node for sender in found).items():
        if count > 1:
            raise InputError(
                f'{count} nodes {name}: each {doing}; if one has just died, wait '
                f'{LEASE_S:g} s; to run two rigs, give each a ROS_DOMAIN_ID of its own'
            )
    return list(found)


def _named_senders(node: Any, topic: str, *, mangled: bool) -> list[Sender]:
    """Return the writers of `topic`, an absolute name, of the types that `node` has there itself.

    If it takes and sends nothing there, writers of all types count.
    """
    own = full_name(node, node.get_name())
    readers = node.get_subscriptions_info_by_topic(topic, no_mangle=mangled)
    deadline = time.monotonic() + LONGEST_SEARCH_S
    while True:
        writers = node.get_publishers_info_by_topic(topic, no_mangle=mangled)
        types = {one.topic_type for one in (*readers, *writers) if sender_name(one) == own}
        found = [
            Sender(sender_name(one), bytes(one.endpoint_gid).hex())
            for one in writers
            if not types or one.topic_type in types
        ]
        awaited = {one.identity for one in found if UNKNOWN_NODE in one.node} - _nameless
        if not awaited or time.monotonic() > deadline:
            _nameless.update(awaited)
            return sorted(found)
        time.sleep(NAME_PERIOD_S)
