"""The answer of a service, waited for in a worker thread.

The executor of the node has to spin in another thread meanwhile. A wait in a callback would
deadlock.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.clock.periods import POLL_S
from porotwin_core.ros import senders


def answer_within(
    client: Any, request: Any, longest_s: float, *, look: Callable[[], None] = lambda: None
) -> Any:
    """Return the response to `request`; None if none came within `longest_s` [s].

    Args:
        client: client of rclpy for a service that is there.
        request: the request.
        longest_s: longest wait [s].
        look: called every half second; whatever it raises ends the wait.
    """
    answered = threading.Event()
    future = client.call_async(request)
    future.add_done_callback(lambda _: answered.set())
    deadline = time.monotonic() + longest_s
    try:
        while (left := deadline - time.monotonic()) > 0.0:
            if answered.wait(min(left, POLL_S)):
                return future.result()
            look()
        return None
    finally:
        client.remove_pending_request(future)


def twin_answer_within(
    node: Any,
    client: Any,
    request: Any,
    longest_s: float,
    *,
    look: Callable[[], None] = lambda: None,
) -> Any:
    """Return what `answer_within` returns, from the one node that may offer the service.

    Args:
        node: the node of the client.
        client: client of rclpy for a service that is there.
        request: the request.
        longest_s: longest wait [s].
        look: called every half second; whatever it raises ends the wait.

    Raises:
        InputError: another node offers it too, or it was started again and the request is lost.
    """
    asked = senders.check_servers(node, client.srv_name)

    def look_around() -> None:
        look()
        if not set(senders.check_servers(node, client.srv_name)) <= set(asked):
            raise InputError(f"service '{client.srv_name}' was started again while it worked")

    response = answer_within(client, request, longest_s, look=look_around)
    senders.check_servers(node, client.srv_name)
    return response
