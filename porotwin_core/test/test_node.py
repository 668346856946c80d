"""Tests of the main loop of nodes: a shutdown at any moment ends it quietly."""

import sys
from collections.abc import Iterator

import pytest
import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.timer import Timer

from porotwin_core.errors import InputError
from porotwin_core.node import run

pytestmark = pytest.mark.graph


class ShutDownBetween(Node):
    """A node whose context is shut down between the executor's check and its wait."""

    def __init__(self) -> None:
        super().__init__('shut_down_between')

    @property
    def timers(self) -> Iterator[Timer]:
        rclpy.try_shutdown(context=self.context)
        yield from super().timers


def broken_node() -> Node:
    raise RCLError('no such luck')


def node_shut_down_while_made() -> Node:
    rclpy.try_shutdown()
    return Node('late')


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, 'argv', ['node'])


@pytest.mark.parametrize('threads', [1, 2])
def test_a_shutdown_between_two_checks_of_the_executor_is_no_failure(threads: int) -> None:
    run(ShutDownBetween, threads=threads)


def test_a_shutdown_while_the_node_is_made_is_no_failure() -> None:
    run(node_shut_down_while_made)


def test_a_failure_of_the_middleware_is_raised() -> None:
    with pytest.raises(RCLError, match='no such luck'):
        run(broken_node)


def test_a_mistake_in_the_parameters_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    complaint = "parameter 'rate' of pump: below 0; name a rate from 0"

    def wrong_node() -> Node:
        raise InputError(complaint)

    with pytest.raises(SystemExit) as ended:
        run(wrong_node)
    assert ended.value.code == 2
    assert capfd.readouterr().err == f'error: {complaint}\n'
