"""The one way to follow a topic whose sender matters: an order, a measured rate, a cycle."""

from collections.abc import Callable
from functools import partial, wraps
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile

from porotwin_core.basis.errors import InputError
from porotwin_core.ros.foreign_words import FewWords, in_short
from porotwin_core.ros.senders import check_senders


def follow(
    node: Node,
    kind: type[Any],
    topic: str,
    on_message: Callable[..., None],
    profile: QoSProfile,
    *,
    refuse: Callable[[str], object] | None = None,
    replayed: bool = True,
    **options: Any,
) -> None:
    """Subscribe `node` to `topic`; all messages are ignored while a stranger could send them.

    Args:
        node: the node.
        kind: type of the messages.
        topic: a key of `senders.SENDERS`.
        on_message: takes a message, and its info if it has a second argument, as in rclpy; it may
            raise InputError to ignore the message.
        profile: quality of service.
        refuse: takes one line about an ignored message; None: the log of the node, a few a minute.
        replayed: whether a replay may send the messages as well.
        options: others of `create_subscription`.
    """
    complain = refuse or partial(FewWords(node.get_logger().error).tell, topic)

    @wraps(on_message)  # rclpy looks at the arguments
    def checked(*message: Any) -> None:
        try:
            check_senders(node, topic, replayed=replayed)
            on_message(*message)
        except InputError as error:
            complain(f'{topic} ignored: {in_short(str(error))}')

    node.create_subscription(kind, topic, checked, profile, **options)
