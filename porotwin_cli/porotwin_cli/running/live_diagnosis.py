"""Asks a running graph for a diagnosis of the run so far."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from rclpy.action import ActionClient
from rclpy.executors import Executor

from porotwin_cli.running.live_node import listening, live_node, silent
from porotwin_cli.terminal import WorkFailed
from porotwin_core.basis.errors import InputError
from porotwin_core.ros.foreign_words import in_short
from porotwin_core.ros.senders import TERMINAL, check_servers, goals_of
from porotwin_core.ros.vouching import Voucher
from porotwin_hub.launching.graph import NAMESPACE
from porotwin_hub.launching.node_processes import POLL_S
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import Outcome

DIAGNOSE = 'diagnosis/diagnose'
"""Action of the diagnosis node."""

SEARCH_S = 10.0
"""Longest search for a node of the graph [s]."""

LAST_ANSWER_S = 2.0
"""Wait for what a node has sent already [s]: a latched offer, or an answer just before its end."""


class Server(Protocol):
    """An action client, as far as waiting for its server goes."""

    def server_is_ready(self) -> bool:
        """Return whether the server answers."""
        ...


def diagnose_run_so_far(
    output: Path, progress: Callable[[str, float], None], *, namespace: str = NAMESPACE
) -> Any:
    """Return the result of the action `diagnosis/diagnose` on the run so far.

    Args:
        output: folder for the report.
        progress: called with the stage and its position in the work, 0 to 1.
        namespace: namespace of the graph.

    Raises:
        InputError: the run so far cannot be diagnosed, or another node offers diagnoses too.
        WorkFailed: no graph with a diagnosis node is running, it ended meanwhile, or it failed.
        KeyboardInterrupt: after Ctrl-C has cancelled the diagnosis.
    """
    node = live_node(TERMINAL, namespace=namespace)
    client, voucher = ActionClient(node, Diagnose, DIAGNOSE), Voucher(node)
    with listening(node) as executor:
        try:
            result = _result(client, voucher, executor, output, progress)
            check_servers(node, goals_of(DIAGNOSE))
        finally:
            client.destroy()
    if result.outcome.code == Outcome.INVALID_INPUT:
        raise InputError(result.outcome.message)
    if result.outcome.code != Outcome.OK:
        raise WorkFailed(result.outcome.message)
    return result


def _result(
    client: ActionClient,
    voucher: Voucher,
    executor: Executor,
    output: Path,
    progress: Callable[[str, float], None],
) -> Any:
    """Send the goal and return its result."""
    if not client.wait_for_server(SEARCH_S):
        raise silent('diagnosis')
    goal = Diagnose.Goal(output=str(output.resolve()))

    def told(message: Any) -> None:
        progress(in_short(message.feedback.stage), message.feedback.fraction)

    voucher.vouch(goals_of(DIAGNOSE), goal)
    handle = _asked(client, executor, lambda: client.send_goal_async(goal, told))
    if not handle.accepted:
        raise WorkFailed('the diagnosis node refused, and its log tells why')
    try:
        return _asked(client, executor, handle.get_result_async).result
    except KeyboardInterrupt:
        _asked(client, executor, lambda: voucher.cancel(DIAGNOSE, handle))
        raise


def _asked(client: ActionClient, executor: Executor, request: Callable[[], Any]) -> Any:
    """Return the answer to `request`, which is sent in the thread that takes the answers.

    rclpy sends a request before it notes that an answer is due. In another thread an answer that
    comes at once is dropped ("Ignoring unexpected result response").
    """
    return answer_of(client, answer_of(client, executor.create_task(request)))


def answer_of(server: Server, future: Any, *, last_answer_s: float = LAST_ANSWER_S) -> Any:
    """Return the result of `future`, which `server` has to set.

    Raises:
        WorkFailed: the server is gone, and no answer came within `last_answer_s`.
    """
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    while not done.wait(POLL_S):
        if not server.server_is_ready() and not done.wait(last_answer_s):
            raise WorkFailed('the graph ended before its diagnosis was done')
    return future.result()
