"""The one way to follow a topic whose sender matters: an order, a measured rate, a cycle."""

import inspect
import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from threading import Lock
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import POLL_S
from porotwin_core.ros.foreign_words import FewWords, in_short
from porotwin_core.ros.senders import check_senders, may_send

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

    A latched topic may never send a true message again that was refused. The subscription is
    therefore made anew as soon as no stranger could send, and a message that was taken before does
    not count twice.
    """

    def __init__(self, node: Node, topic: str, *, replayed: bool | None = None) -> None:
        """Count nothing yet; `topic` and `replayed` are those of `follow`."""
        self._node, self._topic, self._replayed = node, topic, replayed
        self._known: set[str] = set()
        self._unseen = 0
        self._noticed = -math.inf
        self._lock = Lock()
        self._event: Any = None
        self._made: Any = None
        self._timer: Any = None
        self._group: Any = None
        self._latched = False
        self._taken: deque[tuple[int, int]] = deque()
        self._begin: Callable[[], None] = lambda: None

    @property
    def allowed(self) -> frozenset[str]:
        """The full names of the nodes that may publish the topic."""
        return may_send(self._node, self._topic, replayed=self._replayed)

    @property
    def subscription(self) -> Any:
        """The subscription of rclpy at present."""
        return self._made

    def subscribe(
        self, *subscription: Any, on_writer: WriterFn | None = None, **options: Any
    ) -> None:
        """Subscribe as rclpy does, in place of an earlier time; count the writers from then on."""

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

        self._begin, self._group = begin, options.get('callback_group')
        with self._lock:
            if self._made is not None:
                self._end()
            begin()
            profile = self._made.qos_profile
            self._latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
            self._taken = deque(maxlen=profile.depth)

    def _doubt(self) -> None:
        """Have the messages of a latched topic sent again once no stranger could send them."""
        with self._lock:
            if not self._latched:
                return
            # the event that a writer has left may come before the graph knows; no other may follow
            if self._timer is None:
                self._timer = self._node.create_timer(
                    POLL_S,
                    self._renew,
                    callback_group=self._group,
                    clock=Clock(clock_type=ClockType.STEADY_TIME),
                )
            elif self._timer.is_canceled():
                self._timer.reset()

    def _renew(self) -> None:
        """Subscribe anew; the timer is in the group of the messages, so that none is in work."""
        try:
            self.look()
        except InputError:
            return
        with self._lock:
            self._timer.cancel()
            self._end()
            self._begin()

    def _end(self) -> None:
        """Destroy the subscription, but not its event: an executor that takes that would end."""
        for handler in self._made.event_handlers:
            self._node.remove_waitable(handler)
        self._made.event_handlers = []
        self._node.destroy_subscription(self._made)

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

    def check(self, info: Mapping[str, Any]) -> bool:
        """Return whether a message with `info` is new, and check that an allowed node sent it.

        Raises:
            InputError: another node publishes, or has left and may have sent it.
        """
        try:
            self._check(info)
        except InputError:
            self._doubt()
            raise
        if self._latched:
            message = info['source_timestamp'], info['publication_sequence_number']
            if message in self._taken:
                return False
            self._taken.append(message)
        return True

    def _check(self, info: Mapping[str, Any]) -> None:
        self.look()
        # the stamp is of a clock that may be set; an age is wrong for a moment only
        age = (time.time_ns() - info['received_timestamp']) * 1e-9
        if time.monotonic() - age <= self._noticed:
            raise InputError(f'a program published {self._topic} too and has left; end it')


def follow(
    node: Node,
    kind: type[Any],
    topic: str,
    on_message: Callable[..., None],
    profile: QoSProfile,
    *,
    refuse: RefuseFn | None = None,
    replayed: bool | None = None,
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
        replayed: whether a replay may send the messages as well; None: in simulated time alone.
        on_writer: takes the event that a writer was found or has left.
        options: others of `create_subscription`.
    """
    complain = refuse or FewWords(node.get_logger().error, known=[topic]).tell
    wants_info = len(inspect.signature(on_message).parameters) > 1
    writers = Writers(node, topic, replayed=replayed)

    def checked(message: Any, info: Mapping[str, Any]) -> None:
        try:
            if not writers.check(info):
                return
            if wants_info:
                on_message(message, info)
            else:
                on_message(message)
        except InputError as error:
            complain(topic, f'{topic} ignored: {in_short(str(error))}')

    writers.subscribe(kind, topic, checked, profile, on_writer=on_writer, **options)
