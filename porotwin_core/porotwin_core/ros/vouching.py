"""Services that one node alone may call: that node tells beforehand what it asks.

ROS 2 Jazzy does not tell a service who called it, and a program may call and leave unseen. The one
node that may call therefore publishes each request before it makes it. The service takes only what
it has heard so. It follows that topic as every topic whose sender matters.
"""

from collections import deque
from collections.abc import Mapping
from threading import Condition
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from porotwin_core.basis.errors import InputError
from porotwin_core.ros import qos, senders
from porotwin_core.ros.following import follow
from porotwin_core.ros.senders import vouched_by
from porotwin_core.ros.service_answer import LONGEST_SEARCH_S
from porotwin_msgs.msg import Vouched

CALLERS: Mapping[str, str] = {
    'asset/control': senders.GUARD,
    'guard/control': 'hub',
    'operator/confirm': 'page',
    'solver/set_effects': 'mend',
}
"""The only node that calls each service, by its name."""


MOST_WAITING = qos.PHOTO.depth
"""Requests that a service remembers: its only caller makes one at a time, for one photograph."""


class Voucher:
    """Tells which requests its node makes: the side of the caller."""

    def __init__(self, node: Node) -> None:
        """Make the topic of `node`."""
        self._publisher = node.create_publisher(Vouched, vouched_by(node.get_name()), qos.CONFIG)

    def vouch(self, service: str, request: Any) -> None:
        """Tell that `request` to `service` comes from here; call it right before the call."""
        told = Vouched(service=service, request=serialize_message(request))
        self._publisher.publish(told)


class OnlyCaller:
    """Lets one node call a service: the side of the service."""

    def __init__(self, node: Node, service: str) -> None:
        """Guard `service`, a key of `CALLERS`, of `node`."""
        self._node, self._service, self._name = node, service, CALLERS[service]
        self._heard: deque[bytes] = deque(maxlen=MOST_WAITING)
        self._refused = ''
        self._changed = Condition()
        follow(
            node,
            Vouched,
            vouched_by(self._name),
            self._on_vouched,
            qos.CONFIG,
            refuse=self._on_refused,
            replayed=False,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    @property
    def node(self) -> str:
        """Full name of the node that may call."""
        return senders.full_name(self._node, self._name)

    def present(self) -> senders.Sender | None:
        """Return the node that calls the service; None if it is not there.

        Raises:
            InputError: another node could call, or there are several of that name.
        """
        found = senders.callers(self._node, self._service)
        return senders.only(found, self.node, f'calls {self._service}')

    def check(self, request: Any) -> senders.Sender:
        """Return the node that sent `request`. Not for a callback in the group of the topic.

        Raises:
            InputError: the request is not of the only node that may call.
        """
        caller = self.present()
        if caller is None or not self.vouches(request):
            known = f'only {self.node} may, which does not know of it; end that program'
            raise InputError(self._refused or f'a program called {self._service}, and {known}')
        return caller

    def vouches(self, request: Any) -> bool:
        """Return whether the only node that may call has told `request`; its word may come late."""
        kind = type(request)
        wanted = _text(serialize_message(request), kind)
        with self._changed:
            return self._changed.wait_for(
                lambda: any(_text(heard, kind) == wanted for heard in self._heard),
                LONGEST_SEARCH_S,
            )

    def _on_vouched(self, message: Vouched) -> None:
        if message.service != self._service:
            return
        with self._changed:
            self._refused = ''
            self._heard.append(bytes(message.request))
            self._changed.notify_all()

    def _on_refused(self, line: str) -> None:
        with self._changed:
            self._refused = line


def _text(serialized: bytes, kind: type[Any]) -> str:
    """Return a request as text: its bytes differ where nothing is kept, and NaN equals no NaN."""
    return str(deserialize_message(serialized, kind))
