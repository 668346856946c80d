"""The node of a command: it listens to a running graph in a thread of its own."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.node import Node

from porotwin_cli.terminal import WorkFailed
from porotwin_core.ros.node import TwinNode
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.ros_environment import check_room, prepare_environment


def live_node(name: str, *, namespace: str) -> Node:
    """Return a node called `name`, in a context of its own; `listening` gives it its thread.

    Raises:
        InputError: a variable of ROS 2 has a wrong value, or the domain is full.
    """
    prepare_environment()
    check_room(os.environ)
    context = Context()
    rclpy.init(context=context)
    return TwinNode(name, namespace=namespace, context=context)


def silent(node: str, start: str = 'up') -> WorkFailed:
    """Return the error that no `node` of a twin answers, which `./porotwin` with `start` begins."""
    return WorkFailed(
        f'no {node} node answers; start the twin with ./porotwin {start}, on this machine and with '
        'the same --domain or ROS_DOMAIN_ID'
    )


@contextmanager
def listening(node: Node) -> Iterator[Executor]:
    """Call the callbacks of `node` until the block ends, and end the node; yield their executor."""
    thread = NodeThread(node)
    try:
        yield thread.executor
    finally:
        thread.end()
