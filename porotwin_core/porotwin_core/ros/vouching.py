"""Services that one node alone may call: they ask that node whether a request is its own.

ROS 2 Jazzy does not tell a service who called it, and a program may call and leave unseen. The one
node that may call therefore keeps its open requests, and vouches for them when it is asked back.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from threading import Lock
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from porotwin_core.basis.errors import InputError
from porotwin_core.ros import senders
from porotwin_core.ros.service_answer import LONGEST_SEARCH_S, answer_within
from porotwin_msgs.srv import Vouch

CALLERS: Mapping[str, str] = {
    'asset/control': senders.GUARD,
    'guard/control': 'hub',
    'solver/set_effects': 'mend',
}
"""The only node that calls each service, by its name."""


class Voucher:
    """Vouches for the requests that its node waits for: the side of the caller."""

    def __init__(self, node: Node) -> None:
        """Offer the service `vouch` under the name of `node`."""
        self._waiting: list[tuple[str, type[Any], str]] = []
        self._lock = Lock()
        node.create_service(
            Vouch,
            f'{node.get_name()}/vouch',
            self._answer,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    @contextmanager
    def sending(self, service: str, request: Any) -> Iterator[None]:
        """Vouch for `request` to `service` inside the block."""
        own = (service, type(request), _text(serialize_message(request), type(request)))
        with self._lock:
            self._waiting.append(own)
        try:
            yield
        finally:
            with self._lock:
                self._waiting = [one for one in self._waiting if one is not own]

    def _answer(self, asked: Vouch.Request, response: Vouch.Response) -> Vouch.Response:
        with self._lock:
            waiting = list(self._waiting)
        response.sent = any(
            service == asked.service and text == _text(bytes(asked.request), kind)
            for service, kind, text in waiting
        )
        return response


class OnlyCaller:
    """Lets one node call a service: the side of the service."""

    def __init__(self, node: Node, service: str) -> None:
        """Guard `service`, a key of `CALLERS`, of `node`."""
        self._node, self._service, self._name = node, service, CALLERS[service]
        self._client = node.create_client(
            Vouch, f'{self._name}/vouch', callback_group=MutuallyExclusiveCallbackGroup()
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
        """Return the node that sent `request`. Not for a callback in the group of the client.

        Raises:
            InputError: the request is not of the only node that may call.
        """
        caller = self.present()
        asked = Vouch.Request(service=self._service, request=serialize_message(request))
        answer = None
        if caller is not None and self._client.wait_for_service(timeout_sec=LONGEST_SEARCH_S):
            answer = answer_within(self._client, asked, LONGEST_SEARCH_S)
        if caller is None or answer is None or not answer.sent:
            raise InputError(
                f'a program called {self._service}, and only {self.node} may, which does not know '
                'of it; end that program'
            )
        return caller


def _text(serialized: bytes, kind: type[Any]) -> str:
    """Return a request as text: its bytes differ where nothing is kept, and NaN equals no NaN."""
    return str(deserialize_message(serialized, kind))
