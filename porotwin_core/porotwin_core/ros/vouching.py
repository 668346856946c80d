"""Services and actions that few nodes may call: a caller tells beforehand what it asks.

ROS 2 Jazzy does not tell a service who called it, and a program may call and leave unseen. A node
that may call therefore publishes each request before it makes it. The service takes only what it
has heard so. It follows that topic as every topic whose sender matters.
"""

from collections import deque
from collections.abc import Mapping
from functools import partial
from threading import Condition
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.action import CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from porotwin_core.basis.errors import InputError
from porotwin_core.ros import qos, senders
from porotwin_core.ros.following import follow
from porotwin_core.ros.senders import LONGEST_SEARCH_S, cancels_of, goals_of, vouched_by
from porotwin_core.ros.service_answer import twin_answer_within
from porotwin_msgs.msg import Vouched

_ACTIONS: Mapping[str, tuple[str, ...]] = {
    'costa/train': ('trainer', senders.TERMINAL),
    'diagnosis/diagnose': ('mend', senders.TERMINAL),
}

CALLERS: Mapping[str, tuple[str, ...]] = {
    'asset/control': (senders.GUARD,),
    'costa/load': (senders.TERMINAL,),
    'costa/save': (senders.TERMINAL,),
    'guard/control': ('hub',),
    'mend/answer': ('page', senders.TERMINAL),
    'operator/confirm': ('page', senders.TERMINAL),
    'solver/set_effects': ('mend',),
    **{goals_of(action): names for action, names in _ACTIONS.items()},
    **{cancels_of(action): names for action, names in _ACTIONS.items()},
}
"""The only nodes that call each service, by their names. An action has two
services: the request is a goal, or the number of one to cancel."""


MOST_WAITING = qos.VOUCHED.depth
"""Requests that a service remembers: a caller makes one at a time, for one photograph."""


def cancel_request(goal: Any) -> CancelGoal.Request:
    """Return the request to cancel a `goal` (a handle of its client, or of its server)."""
    request = CancelGoal.Request()
    request.goal_info.goal_id = goal.goal_id
    return request


class Voucher:
    """Tells which requests its node makes: the side of the caller."""

    def __init__(self, node: Node) -> None:
        """Make the topic of `node`."""
        self._node = node
        self._publisher = node.create_publisher(Vouched, vouched_by(node.get_name()), qos.VOUCHED)

    def vouch(self, service: str, request: Any) -> None:
        """Tell that `request` to `service` comes from here; call it right before the call."""
        told = Vouched(service=service, request=serialize_message(request))
        self._publisher.publish(told)

    def ask(self, client: Any, service: str, request: Any, longest_s: float, **options: Any) -> Any:
        """Vouch for a `request` by `client`; return the answer as `twin_answer_within` does."""
        self.vouch(service, request)
        return twin_answer_within(self._node, client, request, longest_s, **options)

    def cancel(self, action: str, goal: Any) -> Any:
        """Cancel a `goal` (ClientGoalHandle) of `action`, and return the future of the answer."""
        self.vouch(cancels_of(action), cancel_request(goal))
        return goal.cancel_goal_async()


class OnlyCaller:
    """Lets the nodes of `CALLERS` call a service: the side of the service."""

    def __init__(self, node: Node, service: str) -> None:
        """Guard `service`, a key of `CALLERS`, of `node`."""
        self._node, self._service, self._names = node, service, CALLERS[service]
        self._calls = f'calls {service.removesuffix(goals_of(""))}'
        self._heard: deque[tuple[str, bytes]] = deque(maxlen=MOST_WAITING)
        self._refused = ''
        self._changed = Condition()
        for name in self._names:
            follow(
                node,
                Vouched,
                vouched_by(name),
                partial(self._on_vouched, name),
                qos.VOUCHED,
                refuse=self._on_refused,
                replayed=False,
                callback_group=MutuallyExclusiveCallbackGroup(),
            )

    def present(self) -> list[senders.Sender]:
        """Return the nodes that call the service, at most one of each name.

        Raises:
            InputError: another node could call, or there are several of a name.
        """
        found = senders.callers(self._node, self._service)
        return senders.only(self._node, found, self._names, self._calls)

    def check(self, request: Any) -> senders.Sender:
        """Return the node that sent `request`. Not for a callback in the group of the topic.

        Raises:
            InputError: the request is not of a node that may call.
        """
        self.present()
        name = senders.full_name(self._node, self._voucher_of(request))
        caller = next((one for one in self.present() if one.node == name), None)
        if caller is None:
            allowed = senders.full_name(self._node, ' or '.join(self._names))
            known = f'only {allowed} may, which does not know of it; end that program'
            raise InputError(self._refused or f'a program {self._calls}, and {known}')
        return caller

    def cancels(self, goal: Any) -> CancelResponse:
        """Return whether a `goal` (ServerGoalHandle) is cancelled, as its caller vouches for."""
        try:
            self.check(cancel_request(goal))
        except InputError as error:
            self._node.get_logger().error(f'not cancelled: {error}')
            return CancelResponse.REJECT
        return CancelResponse.ACCEPT

    def _voucher_of(self, request: Any) -> str:
        """Return who has told `request`, '' for nobody; a word may come late, and counts once."""
        kind = type(request)
        wanted = _text(serialize_message(request), kind)

        def told() -> tuple[str, bytes] | None:
            return next((one for one in self._heard if _text(one[1], kind) == wanted), None)

        with self._changed:
            found = self._changed.wait_for(told, LONGEST_SEARCH_S)
            if found is None:
                return ''
            self._heard.remove(found)
            return found[0]

    def _on_vouched(self, name: str, message: Vouched) -> None:
        if message.service != self._service:
            return
        with self._changed:
            self._refused = ''
            self._heard.append((name, bytes(message.request)))
            self._changed.notify_all()

    def _on_refused(self, _topic: str, line: str) -> None:
        with self._changed:
            self._refused = line


def _text(serialized: bytes, kind: type[Any]) -> str:
    """Return a request as text: its bytes differ where nothing is kept, and NaN equals no NaN."""
    return str(deserialize_message(serialized, kind))
