"""The node of a command: it listens to a running graph in a thread of its own."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from porotwin_core.node import END_S, until_shutdown
from porotwin_core.ros_environment import prepare_environment


def live_node(name: str, *, namespace: str) -> Node:
    """Return a node called `name`, in a context of its own; `listening` gives it its thread.

    Raises:
        InputError: a variable of ROS 2 has a wrong value.
    """
    prepare_environment()
    context = Context()
    rclpy.init(context=context)
    return rclpy.create_node(name, namespace=namespace, context=context)


@contextmanager
def listening(node: Node) -> Iterator[SingleThreadedExecutor]:
    """Call the callbacks of `node` until the block ends, and end the node; yield their executor."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor,), daemon=True)
    thread.start()
    try:
        yield executor
    finally:
        rclpy.try_shutdown(context=node.context)
        thread.join(END_S)
        node.destroy_node()


def _spin(executor: SingleThreadedExecutor) -> None:
    with until_shutdown(executor.context):
        executor.spin()
