"""The one way to follow a topic whose sender matters: an order, a measured rate, a cycle."""

import inspect
import math
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from threading import Lock
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.foreign_words import FewWords, in_short
from porotwin_core.ros.senders import check_senders

MATCHED = rclpy_implementation.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MATCHED
"""The event that a writer was found, or has left."""

RefuseFn = Callable[[str, str], object]
"""Takes a topic, and one line about an ignored message of it."""

WriterFn = Callable[[Any], None]
"""Takes the event that a writer was found or has left (QoSSubscriptionMatchedInfo)."""


class Writers:
    """Counts the writers of one subscription, so that none goes unseen.

    A program may publish and leave before a node looks who publishes. The middleware counts all
    writers that it ever found. If more were found than were seen under an allowed name, some have
    left unseen. A message that arrived before this was noticed may be theirs.
    """

    def __init__(self, node: Node, topic: str, *, replayed: bool = True) -> None:
        """Count nothing yet; `topic` and `replayed` are those of `follow`."""
        self._node, self._topic, self._replayed = node, topic, replayed
        self._known: set[str] = set()
        self._unseen = 0
        self._noticed = -math.inf
        self._lock = Lock()
        self._event: Any = None
        self._made: Any = None
        self._begin: Callable[[], None] = lambda: None

    def subscribe(
        self, *subscription: Any, on_writer: WriterFn | None = None, **options: Any
    ) -> None:
        """Subscribe as rclpy does, and count the writers from then on."""

        def matched(event: Any) -> None:
            """Learn the name of a writer while it is there; messages are refused one by one."""
            with suppress(InputError):
                self.look()
            if on_writer is not None:
                on_writer(event)

        events = SubscriptionEventCallbacks(matched=matched)

        def begin() -> None:
            made = self._node.create_subscription(*subscription, event_callbacks=events, **options)
            with made.handle:
                self._event = rclpy_implementation.EventHandle(made.handle, MATCHED)
            self._made, self._unseen, self._noticed = made, 0, -math.inf
            self._known.clear()

        self._begin = begin
        with self._lock:
            begin()

    def _renew(self) -> None:
        """Subscribe anew to a topic that keeps messages: a true one may have been refused."""
        with self._lock:
            if self._made.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                self._node.destroy_subscription(self._made)
                self._begin()

    def look(self) -> None:
        """See who publishes now.

        Raises:
            InputError: another node than those of `SENDERS` does.
        """
        with self._lock:
            # first the count: who matched before it is seen below, unless he has left
            found = self._event.take_event().total_count
            present = check_senders(self._node, self._topic, replayed=self._replayed)
            self._known |= {sender.identity for sender in present}
            if found - len(self._known) > self._unseen:
                self._unseen = found - len(self._known)
                self._noticed = time.monotonic()

    def check(self, info: Mapping[str, Any]) -> None:
        """Check that a message with `info` came from an allowed node.

        Raises:
            InputError: another node publishes, or has left and may have sent it.
        """
        self.look()
        # the stamp is of a clock that may be set; an age is wrong for a moment only
        age = (time.time_ns() - info['received_timestamp']) * 1e-9
        if time.monotonic() - age <= self._noticed:
            self._renew()
            raise InputError(f'a program published {self._topic} too and has left; end it')


def follow(
    node: Node,
    kind: type[Any],
    topic: str,
    on_message: Callable[..., None],
    profile: QoSProfile,
    *,
    refuse: RefuseFn | None = None,
    replayed: bool = True,
    on_writer: WriterFn | None = None,
    **options: Any,
) -> None:
    """Subscribe `node` to `topic`; a message is ignored if a stranger could have sent it.

    Args:
        node: the node.
        kind: type of the messages.
        topic: a key of `senders.SENDERS`.
        on_message: takes a message, and its info if it has a second argument, as in rclpy; it may
            raise InputError to ignore the message.
        profile: quality of service.
        refuse: takes the topic, and one line about an ignored message; None: the node's log.
        replayed: whether a replay may send the messages as well.
        on_writer: takes the event that a writer was found or has left.
        options: others of `create_subscription`.
    """
    complain = refuse or FewWords(node.get_logger().error, known=[topic]).tell
    wants_info = len(inspect.signature(on_message).parameters) > 1
    writers = Writers(node, topic, replayed=replayed)

    def checked(message: Any, info: Mapping[str, Any]) -> None:
        try:
            writers.check(info)
            if wants_info:
                on_message(message, info)
            else:
                on_message(message)
        except InputError as error:
            complain(topic, f'{topic} ignored: {in_short(str(error))}')

    writers.subscribe(kind, topic, checked, profile, on_writer=on_writer, **options)
