"""The node of a command hears the graph until its block ends."""

import threading

import pytest
from patience import until

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_cli.running.live_node import listening, live_node  # noqa: E402
from porotwin_core.ros import qos  # noqa: E402
from porotwin_msgs.msg import CleanState  # noqa: E402

pytestmark = pytest.mark.graph


def test_messages_are_heard_in_a_thread_until_the_block_ends() -> None:
    heard = threading.Event()
    threads = []

    def hear(_: CleanState) -> None:
        threads.append(threading.current_thread())
        heard.set()

    sender = live_node('sender', namespace='/porotwin')
    node = live_node('watch', namespace='/porotwin')
    publisher = sender.create_publisher(CleanState, 'asset/clean_state', qos.FIELD)
    node.create_subscription(CleanState, 'asset/clean_state', hear, qos.FIELD)
    with listening(sender), listening(node):
        until(lambda: publisher.publish(CleanState()) or heard.wait(0.1))
    assert threading.current_thread() not in threads
    assert not node.context.ok()
    assert not any(thread.is_alive() for thread in threads)


def test_an_error_in_the_block_ends_the_node() -> None:
    node = live_node('watch', namespace='/porotwin')
    with pytest.raises(KeyboardInterrupt), listening(node):
        raise KeyboardInterrupt
    assert not node.context.ok()
