"""Asks the running graph for a diagnosis of the run so far."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor

from porotwin_cli.output import WorkFailed
from porotwin_core.errors import InputError
from porotwin_core.node import until_shutdown
from porotwin_hub.graph import NAMESPACE
from porotwin_msgs.action import Diagnose
from porotwin_msgs.msg import Outcome

SEARCH_S = 10.0
"""Longest look for the graph's diagnosis node."""

LAST_ANSWER_S = 2.0
"""An answer given just before the node ended is here by then."""


def diagnose_run_so_far(output: Path, progress: Callable[[str, float], None]) -> Any:
    """Return the result of the action `diagnosis/diagnose` on the run so far, written to `output`.

    `progress` is told the stage and the share done. An interrupt calls the diagnosis off.

    Raises:
        InputError: the run so far cannot be judged.
        WorkFailed: no graph with a diagnosis node is running, it ended meanwhile, or it failed.
    """
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node('diagnose', namespace=NAMESPACE, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    threading.Thread(target=_spin, args=(executor,), daemon=True).start()
    client = ActionClient(node, Diagnose, 'diagnosis/diagnose')
    try:
        if not client.wait_for_server(SEARCH_S):
            raise WorkFailed(
                'no diagnosis node answers; start the twin with ./porotwin up, on this machine '
                'and with the same ROS_DOMAIN_ID'
            )
        goal = Diagnose.Goal(output=str(output.resolve()))
        awaited = _Patience(client)
        handle = awaited(
            client.send_goal_async(
                goal, lambda message: progress(message.feedback.stage, message.feedback.fraction)
            )
        )
        try:
            result = awaited(handle.get_result_async()).result
        except KeyboardInterrupt:
            awaited(handle.cancel_goal_async())
            raise
    finally:
        client.destroy()
        rclpy.try_shutdown(context=context)
    if result.outcome.code == Outcome.INVALID_INPUT:
        raise InputError(result.outcome.message)
    if result.outcome.code != Outcome.OK:
        raise WorkFailed(result.outcome.message)
    return result


def _spin(executor: SingleThreadedExecutor) -> None:
    with until_shutdown(executor.context):
        executor.spin()


class _Patience:
    """Waits for answers of an action server, no longer than it is there."""

    def __init__(self, client: ActionClient) -> None:
        self._client = client

    def __call__(self, future: Any) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        while not done.wait(0.2):  # short waits leave room for an interrupt
            if not self._client.server_is_ready() and not done.wait(LAST_ANSWER_S):
                raise WorkFailed('the graph ended before its diagnosis was done')
        return future.result()
