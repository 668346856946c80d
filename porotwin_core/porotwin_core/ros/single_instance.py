"""One node of a name per domain and namespace: a second one is refused with one line.

Two graphs in one domain would mix their photographs and setpoints silently. On one machine a lock
shows whether the other node lives. The kernel frees the lock when a process ends, however it ends.
For other machines only discovery is left. Discovery still shows a killed process for some seconds:
a ghost. The lock file holds the identity of its last owner. So a restarted node recognises its
ghost and need not wait.
"""

import fcntl
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import END_S, POLL_S
from porotwin_core.ros.senders import LEASE_S, publishers

DISCOVERY_S = 1.0
"""Time until nodes on other machines are discovered [s]."""

GHOST_S = LEASE_S + END_S
"""Longest time that discovery remembers a killed process [s]."""

PARTICIPANT_DIGITS = 24
"""Hexadecimal digits of a DDS identity that name the participant: one process has one."""

EVERY_NODES_TOPIC = '/parameter_events'
"""A topic that every node publishes."""

_claims: dict[str, 'Claim'] = {}


class Claim:
    """The right to a node's full name in a domain, held until the process ends.

    `known` are the identities in DDS of the node itself and of the ghosts of its predecessors.
    """

    def __init__(self, lock: int, ghosts: frozenset[str]) -> None:
        """Keep the open file `lock`, which holds the lock."""
        self._lock = lock
        self.known = ghosts

    def adopt(self, node: Node) -> None:
        """Note the identity of `node`, which bears the claimed name, for its successor, too."""
        own = _identity(node)
        os.ftruncate(self._lock, 0)
        os.pwrite(self._lock, own.encode('ascii'), 0)
        self.known |= {own}
        _claims[node.get_fully_qualified_name()] = self


def only_one(make_node: Callable[[], Node], name: str) -> Callable[[], Node]:
    """Return `make_node` with a check that no other node `name` lives in the domain.

    Use it in `main`: `run(only_one(SolverNode, 'solver'))`. The result raises InputError if
    another node lives. It waits for a node that has just died.
    """

    def make() -> Node:
        claim = claim_name(name)
        node = make_node()
        claim.adopt(node)
        return node

    return make


def claim_name(name: str) -> Claim:
    """Return the claim of this process to the node name `name`, with remappings.

    Raises:
        InputError: another node has that name, in the same namespace and domain.
    """
    probe = Node(name, enable_rosout=False, start_parameter_services=False)
    try:
        full_name = probe.get_fully_qualified_name()
        lock = _locked(full_name, probe.context.get_domain_id())
        ghosts = frozenset(os.pread(lock, 4096, 0).decode('ascii', 'ignore').split())
        _wait_for_others(probe, full_name, ghosts | {_identity(probe)})
    finally:
        probe.destroy_node()
    return Claim(lock, ghosts)


def another_lives(node: Node) -> str:
    """Return a line if another node has the name of `node`, else an empty string.

    Only a node that was made behind `only_one` knows; nodes that start at the same moment on two
    machines see each other here.
    """
    full_name = node.get_fully_qualified_name()
    claim = _claims.get(full_name)
    if claim is None or _identities(node, full_name) <= claim.known:
        return ''
    return _refusal(full_name)


def _refusal(full_name: str) -> str:
    return (
        f'another node {full_name} runs in this ROS domain; stop it, or set ROS_DOMAIN_ID to '
        'another number to run two twins'
    )


def _locked(full_name: str, domain: int) -> int:
    """Return the open and locked file of a node's name on this machine.

    Raises:
        InputError: another process holds the lock.
    """
    # nodes of another user of this machine are found by discovery
    file = f'porotwin_{os.getuid()}_domain_{domain}{full_name.replace("/", "_")}.lock'
    path = Path(tempfile.gettempdir()) / file
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; remove it') from None
    deadline = time.monotonic() + END_S
    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > deadline:
                os.close(lock)
                raise InputError(_refusal(full_name)) from None
            time.sleep(POLL_S)
        else:
            return lock


def _identity(node: Node) -> str:
    """Return the identity of `node`, from a topic that nobody else publishes."""
    topic = f'{node.get_name()}_{os.getpid()}_{time.monotonic_ns()}'
    publisher = node.create_publisher(ParameterEvent, topic, 1)
    (own,) = publishers(node, topic)
    node.destroy_publisher(publisher)
    return own.identity[:PARTICIPANT_DIGITS]


def _wait_for_others(probe: Node, full_name: str, known: frozenset[str]) -> None:
    """Return when no other node of that name is discovered; a ghost disappears with time.

    Raises:
        InputError: one remains.
    """
    begin = time.monotonic()
    while True:
        waited = time.monotonic() - begin
        if not _identities(probe, full_name) - known:
            if waited >= DISCOVERY_S:
                return
        elif waited >= GHOST_S:
            raise InputError(_refusal(full_name))
        time.sleep(POLL_S)


def _identities(node: Node, full_name: str) -> set[str]:
    """Return the identities of all processes that have a node `full_name`, also of ghosts."""
    return {
        sender.identity[:PARTICIPANT_DIGITS]
        for sender in publishers(node, EVERY_NODES_TOPIC)
        if sender.node == full_name
    }
