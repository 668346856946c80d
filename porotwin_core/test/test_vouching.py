"""Tests of services that one node alone may call."""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from patience import PATIENCE_S, until

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from action_msgs.srv import CancelGoal  # noqa: E402
from rclpy.action import ActionClient, ActionServer  # noqa: E402
from rclpy.callback_groups import ReentrantCallbackGroup  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402

from porotwin_core.basis.errors import InputError  # noqa: E402
from porotwin_core.ros import conversions, qos, senders  # noqa: E402
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_core.ros.senders import SENDERS, cancels_of, vouched_by  # noqa: E402
from porotwin_core.ros.service_answer import answer_within  # noqa: E402
from porotwin_core.ros.vouching import CALLERS, OnlyCaller, Voucher, cancel_request  # noqa: E402
from porotwin_msgs.action import Diagnose  # noqa: E402
from porotwin_msgs.msg import Effect, Setpoint, Vouched  # noqa: E402
from porotwin_msgs.srv import AnswerMend, Control, SetEffects  # noqa: E402

pytestmark = pytest.mark.graph

SERVICE = 'asset/control'
ACTION = 'diagnosis/diagnose'


SEARCH, QUICK_S = 'porotwin_core.ros.vouching.LONGEST_SEARCH_S', 0.2
"""Longest wait for a word, and the one for a word that never comes [s]."""

NODES = ('pumps', 'guard', 'page', 'terminal', 'stranger')


class Pumps:
    """A node that takes setpoints, and keeps the taken and the refused ones."""

    def __init__(self, node: Any) -> None:
        self.taken: list[int] = []
        self.refused: list[str] = []
        self._guard = OnlyCaller(node, SERVICE)
        node.create_service(Control, SERVICE, self._on_control)

    def _on_control(self, request: Control.Request, response: Control.Response) -> Control.Response:
        try:
            self._guard.check(request)
            self.taken.append(request.setpoint.sequence)
            response.outcome = conversions.ok()
        except InputError as error:
            self.refused.append(str(error))
            response.outcome = conversions.refusal(error)
        return response


class Guard:
    """A node that sends setpoints and vouches for them."""

    def __init__(self, node: Any) -> None:
        self.voucher = Voucher(node)
        self.client = node.create_client(Control, SERVICE)

    def send(self, number: int) -> Any:
        request = Control.Request(setpoint=Setpoint(sequence=number))
        assert self.client.wait_for_service(PATIENCE_S)
        self.voucher.vouch(SERVICE, request)
        return answer_within(self.client, request, PATIENCE_S).outcome


@pytest.fixture
def graph(domain: int) -> Iterator[Callable[[str], Any]]:
    """Make nodes by name; each spins in threads of its own."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    nodes = [rclpy.create_node(name, context=context) for name in NODES]
    spinning = NodeThread(*nodes, threads=4)
    yield {node.get_name(): node for node in nodes}.__getitem__
    spinning.end()


def result_of(future: Any) -> Any:
    """Return the result of a future."""
    until(future.done)
    return future.result()


def call_and_leave(node: Any, number: int) -> None:
    """Call the pumps as `node`, wait for no answer, and be gone from the graph."""
    client = node.create_client(Control, SERVICE)
    assert client.wait_for_service(PATIENCE_S)
    client.call_async(Control.Request(setpoint=Setpoint(sequence=number)))
    node.destroy_client(client)


@pytest.mark.filterwarnings('ignore:failed to send response')
def test_a_request_is_taken_from_the_only_node_that_vouches_for_it(
    graph: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pumps, guard = Pumps(graph('pumps')), Guard(graph('guard'))
    assert guard.send(1).code == conversions.ok().code
    monkeypatch.setattr(SEARCH, QUICK_S)
    for brief in range(5):
        call_and_leave(graph('stranger'), 666)
        until(lambda told=brief: len(pumps.refused) > told)
    monkeypatch.undo()
    assert guard.send(2).code == conversions.ok().code
    assert pumps.taken == [1, 2]
    assert all('/stranger calls' in one or 'does not know of it' in one for one in pumps.refused)


def test_a_client_of_the_same_node_is_no_proof(
    graph: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pumps, guard = Pumps(graph('pumps')), Guard(graph('guard'))
    other = Control.Request(setpoint=Setpoint(sequence=7))
    guard.voucher.vouch('guard/control', other)
    assert guard.client.wait_for_service(PATIENCE_S)
    monkeypatch.setattr(SEARCH, QUICK_S)
    answer = answer_within(guard.client, other, PATIENCE_S)
    assert 'does not know of it' in answer.outcome.message
    assert pumps.taken == []


def test_a_request_is_refused_while_nobody_may_call(graph: Callable[[str], Any]) -> None:
    caller = OnlyCaller(graph('pumps'), SERVICE)
    with pytest.raises(InputError, match='a program calls asset/control'):
        caller.check(Control.Request())


def test_a_request_with_nan_is_vouched_for(graph: Callable[[str], Any]) -> None:
    voucher, caller = Voucher(graph('guard')), OnlyCaller(graph('pumps'), SERVICE)
    graph('guard').create_client(Control, SERVICE)
    request: Any = SetEffects.Request(effects=[Effect(parameter_values=[float('nan'), 0.1])])
    until(lambda: senders.callers(graph('pumps'), SERVICE))
    voucher.vouch(SERVICE, request)
    assert caller.check(request).node == '/guard'
    request.effects[0].parameter_values[1] = 0.2
    with pytest.raises(InputError):
        caller.check(request)


def test_every_request_of_a_burst_is_vouched_for_and_no_word_counts_twice(
    graph: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    guard, pumps = graph('guard'), graph('pumps')
    voucher, caller = Voucher(guard), OnlyCaller(pumps, SERVICE)
    guard.create_client(Control, SERVICE)
    until(lambda: senders.callers(pumps, SERVICE))
    burst = [Control.Request(setpoint=Setpoint(sequence=number)) for number in range(5)]
    for request in burst:
        voucher.vouch(SERVICE, request)
    for request in burst:
        assert caller.check(request).node == '/guard'
    # a stranger makes the words doubtful, which are sent again when it has left
    forged = graph('stranger').create_publisher(Vouched, vouched_by('guard'), qos.VOUCHED)
    until(forged.get_subscription_count)
    forged.publish(Vouched(service=SERVICE))
    until(lambda: caller._refused)
    with pytest.raises(InputError, match='/stranger publishes'):
        caller.check(burst[0])
    graph('stranger').destroy_publisher(forged)
    last = Control.Request(setpoint=Setpoint(sequence=9))
    voucher.vouch(SERVICE, last)
    assert caller.check(last).node == '/guard'  # the words before it have come again
    monkeypatch.setattr(SEARCH, QUICK_S)
    with pytest.raises(InputError):
        caller.check(burst[-1])


def test_who_may_not_send_goals_cannot_cancel_them(graph: Callable[[str], Any]) -> None:
    server, terminal, stranger = graph('pumps'), graph('terminal'), graph('stranger')
    callers = OnlyCaller(server, cancels_of(ACTION))
    ended = threading.Event()

    def execute(goal: Any) -> Any:
        while not (goal.is_cancel_requested or ended.wait(0.01)):
            pass
        goal.canceled() if goal.is_cancel_requested else goal.abort()
        return Diagnose.Result()

    ActionServer(
        server,
        Diagnose,
        ACTION,
        execute,
        cancel_callback=callers.cancels,
        callback_group=ReentrantCallbackGroup(),
    )
    client, voucher = ActionClient(terminal, Diagnose, ACTION), Voucher(terminal)
    assert client.wait_for_server(PATIENCE_S)
    goal = result_of(client.send_goal_async(Diagnose.Goal()))
    cancelling = stranger.create_client(CancelGoal, cancels_of(ACTION))
    assert cancelling.wait_for_service(PATIENCE_S)
    for request in (CancelGoal.Request(), cancel_request(goal)):
        assert result_of(cancelling.call_async(request)).goals_canceling == []
    stranger.destroy_client(cancelling)
    until(lambda: len(senders.callers(server, cancels_of(ACTION))) == 1)
    assert result_of(goal.cancel_goal_async()).goals_canceling == []  # nobody vouches for it
    assert result_of(voucher.cancel(ACTION, goal)).goals_canceling != []
    ended.set()


def test_a_service_of_several_callers_knows_which_one_asks(
    graph: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    caller = OnlyCaller(graph('pumps'), 'mend/answer')
    for name in ('page', 'terminal'):
        node = graph(name)
        voucher = Voucher(node)
        node.create_client(AnswerMend, 'mend/answer')
        request = AnswerMend.Request(sequence=len(name))
        until(lambda one=f'/{name}': one in [found.node for found in caller.present()])
        monkeypatch.setattr(SEARCH, QUICK_S)
        with pytest.raises(InputError, match='only /page or terminal may, which does not know'):
            caller.check(request)
        monkeypatch.undo()
        voucher.vouch('mend/answer', request)
        assert caller.check(request).node == f'/{name}'
        monkeypatch.setattr(SEARCH, QUICK_S)
        with pytest.raises(InputError, match='which does not know'):
            caller.check(request)  # a word counts once
        monkeypatch.undo()


def test_a_stranger_cannot_vouch(graph: Callable[[str], Any]) -> None:
    pumps, guard = Pumps(graph('pumps')), Guard(graph('guard'))
    assert guard.send(1).code == conversions.ok().code
    forged = Control.Request(setpoint=Setpoint(sequence=666))
    stranger = graph('stranger')
    publisher = stranger.create_publisher(Vouched, vouched_by('guard'), qos.VOUCHED)
    until(publisher.get_subscription_count)
    publisher.publish(Vouched(service=SERVICE, request=serialize_message(forged)))
    answer = answer_within(guard.client, forged, PATIENCE_S)  # even from the guard
    assert '/stranger publishes guard/_vouched too' in answer.outcome.message
    stranger.destroy_publisher(publisher)
    until(lambda: guard.send(2).code == conversions.ok().code)
    assert 666 not in pumps.taken


def test_every_caller_is_a_node_of_the_graph() -> None:
    assert {vouched_by(name) for names in CALLERS.values() for name in names} <= SENDERS.keys()
