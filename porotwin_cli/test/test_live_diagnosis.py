"""Waiting for an answer of a running graph."""

from concurrent.futures import Future

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from porotwin_cli.running.live_diagnosis import answer_of
from porotwin_cli.terminal import WorkFailed


class FakeServer:
    """Stands for an action client; `ready` says whether its server is there."""

    def __init__(self, *, ready: bool) -> None:
        self.ready = ready

    def server_is_ready(self) -> bool:
        return self.ready


def test_waiting_ends_with_the_graph() -> None:
    with pytest.raises(WorkFailed, match='the graph ended'):
        answer_of(FakeServer(ready=False), Future(), last_answer_s=0.1)


def test_an_answer_is_returned() -> None:
    future: Future[str] = Future()
    future.set_result('leak')
    assert answer_of(FakeServer(ready=True), future) == 'leak'


def test_an_answer_just_before_the_end_of_the_graph_counts() -> None:
    class LateServer(FakeServer):
        def server_is_ready(self) -> bool:
            future.set_result('leak')
            return False

    future: Future[str] = Future()
    assert answer_of(LateServer(ready=False), future, last_answer_s=0.1) == 'leak'
