"""Tests of the page node in a running graph: messages are shown, confirmations arrive."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import patience
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from page_examples import GRID, RIG, RIG_FILE, TOKEN, map_at, ml_h, rates
from patience import PATIENCE_S
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from refused_node import refusal

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import to_ml_h
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.node_thread import NodeThread
from porotwin_core.ros.senders import SENDERS
from porotwin_core.ros.vouching import OnlyCaller
from porotwin_msgs.msg import (
    CleanState,
    CycleReport,
    MendOffer,
    NewState,
    RigDescription,
    Setpoint,
    TracerField,
    WellRates,
)
from porotwin_msgs.srv import AnswerMend, ConfirmRates
from porotwin_page import page_node
from porotwin_page.address import listen
from porotwin_page.mend_answer import LONGEST_ANSWER_S

pytestmark = pytest.mark.graph


def free_address() -> str:
    with listen('127.0.0.1:0') as taken:
        return f'127.0.0.1:{taken.getsockname()[1]}'


def start_page(address: str, *parameters: str) -> subprocess.Popen:
    command = [
        sys.executable,
        '-m',
        'porotwin_page.page_node',
        '--ros-args',
        '-r',
        '__ns:=/porotwin',
    ]
    for parameter in (f'address:={address}', *parameters):
        command += ['-p', parameter]
    return subprocess.Popen(
        command,
        env={**os.environ, 'PYTHONUNBUFFERED': '1'},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@contextlib.contextmanager
def page(address: str, *parameters: str) -> Iterator[subprocess.Popen]:
    process = start_page(address, *parameters)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=PATIENCE_S)


def until(condition: Callable[[], Any], what: str) -> Any:
    """Return what `condition` returns once it is true; a page that does not answer yet is not."""

    def answered() -> Any:
        with contextlib.suppress(OSError):
            return condition()
        return None

    return patience.until(answered, what, look=lambda _: time.sleep(0.1))


def newest_event(address: str) -> dict:
    with urllib.request.urlopen(f'http://{address}/events', timeout=PATIENCE_S) as response:
        return json.loads(response.readline().removeprefix(b'data: '))


def post(address: str, body: dict, what: str = 'confirm') -> tuple[int, dict]:
    request = urllib.request.Request(
        f'http://{address}/{what}',
        json.dumps(body).encode(),
        {'Content-Type': 'application/json', 'Authorization': f'Bearer {TOKEN}'},
    )
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as response:
            return response.status, json.load(response)
    except urllib.error.HTTPError as error:
        return error.code, json.load(error)


class Hub(Node):
    """The rest of the graph: publishes data for the page and receives its confirmations.

    Its node has the name of the guard. Other topics have nodes of their own.
    """

    def __init__(self, context: rclpy.Context) -> None:
        super().__init__('guard', namespace='/porotwin', context=context)
        self.requests: list[ConfirmRates.Request] = []
        self.operator = rclpy.create_node('operator', namespace='/porotwin', context=context)
        self.mend = rclpy.create_node('mend', namespace='/porotwin', context=context)
        nodes = {'guard': self, 'operator': self.operator, 'mend': self.mend}
        for name in ('hub', 'imaging'):
            nodes[name] = rclpy.create_node(name, namespace='/porotwin', context=context)
        self.publishers_by_topic = {
            topic: nodes[SENDERS.get(topic, ('hub',))[0]].create_publisher(kind, topic, profile)
            for topic, kind, profile in (
                ('rig/description', RigDescription, qos.CONFIG),
                ('asset/new_state', NewState, qos.FIELD),
                ('asset/clean_state', CleanState, qos.FIELD),
                ('tracer/predicted', TracerField, qos.FIELD),
                ('tracer/corrected', TracerField, qos.FIELD),
                ('wells/setpoint', Setpoint, qos.SETPOINT),
                ('wells/measured', WellRates, qos.FIELD),
                ('hub/cycle', CycleReport, qos.FIELD),
                ('/diagnostics', DiagnosticArray, 10),
            )
        }

    def offer_confirmation(self) -> None:
        self.operator.create_service(ConfirmRates, 'operator/confirm', self._confirm)

    def _confirm(
        self, request: ConfirmRates.Request, response: ConfirmRates.Response
    ) -> ConfirmRates.Response:
        self.requests.append(request)
        response.outcome = conversions.ok()
        now = self.get_clock().now().to_msg()
        message = WellRates(start=now, wells=conversions.rates_to_msg(rates(118.0)))
        message.header.stamp = now
        self.send('wells/measured', message)
        return response

    def ask_about_odd_rates(self) -> None:
        """Refuse every confirmation once, as the operator node does with rates out of balance."""

        def confirm(
            request: ConfirmRates.Request, response: ConfirmRates.Response
        ) -> ConfirmRates.Response:
            caller.check(request)
            self.requests.append(request)
            again = len(self.requests) % 2 == 0
            question = InputError('confirm the same once more')
            response.outcome = conversions.ok() if again else conversions.refusal(question)
            return response

        caller = OnlyCaller(self.operator, 'operator/confirm')
        self.operator.create_service(ConfirmRates, 'operator/confirm', confirm)

    def send(self, topic: str, message: Any) -> None:
        self.publishers_by_topic[topic].publish(message)

    def all_topics_have_subscribers(self) -> bool:
        return all(
            publisher.get_subscription_count() > 0
            for publisher in self.publishers_by_topic.values()
        )

    def publish_cycle(self, now: float) -> None:
        """Publish a photograph of the time `now` [s] and all messages of its cycle."""

        def tracer(value: float) -> TracerField:
            return conversions.tracer_to_msg(map_at(0, value).concentration, GRID, now)

        self.send('tracer/predicted', tracer(0.3))
        self.send('tracer/corrected', tracer(0.2))
        # the topics keep no order between them
        time.sleep(0.5)
        header = conversions.header_at(now)
        self.send(
            'asset/new_state',
            NewState(
                header=header,
                sequence=7,
                time_step=conversions.duration_to_msg(30.0),
                tracer=tracer(0.25),
                calibrated=True,
            ),
        )
        self.send(
            'wells/setpoint',
            Setpoint(
                header=header,
                sequence=3,
                valid_until=conversions.time_to_msg(now + 90.0),
                wells=conversions.rates_to_msg(rates(120.0)),
                reason='least tracer',
            ),
        )
        time.sleep(0.5)
        self.send(
            'hub/cycle',
            CycleReport(
                header=header,
                sequence=7,
                prediction_error=0.2,
                corrected_error=float('nan'),
                disallowed_tracer=1e-6,
                cycle_duration=conversions.duration_to_msg(1.25),
                correction_status='no model loaded',
            ),
        )
        own = DiagnosticStatus(
            level=DiagnosticStatus.WARN,
            name='hub',
            hardware_id='porotwin',
            message='state 7 done',
        )
        foreign = DiagnosticStatus(level=DiagnosticStatus.ERROR, name='hub', message='no cable')
        self.send('/diagnostics', DiagnosticArray(status=[own, foreign]))


@pytest.fixture
def hub() -> Iterator[Hub]:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Hub(context)
    thread = NodeThread(node, node.operator, node.mend, threads=2)
    yield node
    thread.end()


def test_messages_are_shown_and_a_confirmation_reaches_the_operator(hub, tmp_path) -> None:
    address = free_address()
    (tmp_path / 'token').write_text(TOKEN)
    hub.send('rig/description', conversions.rig_to_msg(RIG))
    with page(address, f'token_file:={tmp_path / "token"}'):
        until(lambda: newest_event(address)['rig'], 'the latched rig description')
        until(hub.all_topics_have_subscribers, 'subscriptions of the page to all topics')
        hub.publish_cycle(time.time())
        shown = until(
            lambda: (event := newest_event(address))['history']['points'] and event, 'a cycle'
        )
        panels = shown['panels']
        wells = {well['name']: well for well in panels['pump_settings']['wells']}
        assert shown['header']['rig_name'] == RIG.name
        assert shown['header']['photo']['sequence'] == 7
        assert wells['control1']['rate_ml_h'] == pytest.approx(120.0)
        assert 0 < panels['pump_settings']['remaining_s'] <= 90
        assert panels['difference']['high'] == 0.05
        errors = shown['history']['points'][0]['values']['forecast_error']
        assert errors['model alone'] == pytest.approx(20.0)
        assert errors['corrected'] is None
        with urllib.request.urlopen(
            f'http://{address}/map/difference.png', timeout=PATIENCE_S
        ) as response:
            assert response.read().startswith(b'\x89PNG')
        health = until(
            lambda: (
                {
                    line['name']: line['level']
                    for line in newest_event(address)['panels']['node_health']
                    if line['name'] in ('hub', 'page', 'another device: hub')
                }
                == {'hub': 'warn', 'page': 'ok', 'another device: hub': 'error'}
            ),
            'health of both nodes, and of another device with the name of one',
        )
        assert health

        assert panels['pump_settings']['doubt'] == ''
        assert shown['states'] == {'first': 1, 'last': 1}
        as_shown = {'sequence': 3, 'rates_ml_h': ml_h(rates(120.0))}
        status, answer = post(address, as_shown)
        assert status == 503
        assert 'the operator node is absent' in answer['error']

        hub.offer_confirmation()
        status, answer = until(
            lambda: (
                (given := post(address, {'sequence': 3, 'rates_ml_h': ml_h(rates(118.0))}))[0]
                == 200
                and given
            ),
            'a confirmation',
        )
        assert answer == {'message': 'setpoint 3 confirmed'}
        request = hub.requests[-1]
        assert request.sequence == 3
        assert {well.well: round(to_ml_h(well.rate), 6) for well in request.wells} == (
            ml_h(rates(118.0))
        )
        setpoint = until(
            lambda: (
                (shown := newest_event(address)['panels']['pump_settings'])
                and shown['wells'][2]['before_ml_h']
                and shown
            ),
            'the reported rates',
        )
        assert setpoint['confirmed']
        assert setpoint['wells'][2]['before_ml_h'] == pytest.approx(118.0)
        logged = newest_event(address)['panels']['setpoint_log']
        assert [line['event'] for line in logged] == ['reported', 'setpoint']

        stranger = Node('stranger', namespace='/porotwin', context=hub.context)
        stranger.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
        until(
            lambda: 'stranger' in str(newest_event(address)['panels']['alarm']),
            'the name of the other publisher',
        )
        stranger.destroy_node()


def test_odd_rates_are_recorded_when_the_operator_has_said_yes(hub, tmp_path) -> None:
    address = free_address()
    (tmp_path / 'token').write_text(TOKEN)
    hub.ask_about_odd_rates()
    with page(address, f'token_file:={tmp_path / "token"}', f'rig:={RIG_FILE}'):
        until(hub.all_topics_have_subscribers, 'subscriptions of the page to all topics')
        hub.publish_cycle(time.time())
        until(lambda: newest_event(address)['panels']['pump_settings'], 'a setpoint')
        odd = {'sequence': 3, 'rates_ml_h': {**ml_h(rates(120.0)), 'producer': -500.0}}
        asked = until(lambda: (found := post(address, odd))[0] != 503 and found, 'an answer')
        assert (asked[0], hub.requests) == (409, [])
        assert post(address, {**odd, 'sure': True}) == (200, {'message': 'setpoint 3 confirmed'})


class SetClock:
    """A clock of a machine that somebody sets."""

    def __init__(self) -> None:
        self.seconds = time.time()

    def now(self) -> Time:
        return Time(nanoseconds=round(1e9 * self.seconds))


@pytest.fixture
def own_page() -> Iterator[tuple[page_node.PageNode, str]]:
    """A page in this process that no thread spins, and its address."""
    address, context = free_address(), rclpy.Context()
    rclpy.init(context=context)
    own = [Parameter('address', value=address)]
    node = page_node.PageNode(context=context, parameter_overrides=own)
    yield node, address
    node.destroy_node()
    rclpy.shutdown(context=context)


def test_an_offer_without_a_confidence_does_not_stop_the_page(own_page) -> None:
    node, address = own_page
    take = node._checked('mend/offer', node._on_offer)
    take(MendOffer(sequence=1, confidence=float('nan'), sentence='a leak'))
    assert newest_event(address)['panels']['mend'] is None
    take(MendOffer(sequence=2, confidence=0.95, sentence='a leak'))
    assert newest_event(address)['panels']['mend']['confidence_percent'] == 95


def test_a_page_without_a_free_thread_is_an_error(own_page, monkeypatch) -> None:
    node, _ = own_page
    told: list[tuple[bytes, str]] = []
    monkeypatch.setattr(node._diagnostics, 'report', lambda level, text: told.append((level, text)))
    node._update_nodes()
    monkeypatch.setattr(node._application.workers, '_busy_since', time.monotonic() - 60.0)
    node._update_nodes()
    assert [level for level, _ in told] == [DiagnosticStatus.OK, DiagnosticStatus.ERROR]
    assert 'at work for 60 s' in told[1][1]


def test_a_clock_that_is_set_back_makes_no_setpoint_valid_for_longer(own_page, monkeypatch) -> None:
    (node, address), clock = own_page, SetClock()
    monkeypatch.setattr(node, 'get_clock', lambda: clock)
    message = Setpoint(header=conversions.header_at(clock.seconds), sequence=3)
    message.valid_until = conversions.time_to_msg(clock.seconds + 90.0)
    message.wells = conversions.rates_to_msg(rates(120.0))
    node._on_setpoint(message)
    for step in (-3600.0, 7200.0):
        clock.seconds += step
        assert 0 < newest_event(address)['panels']['pump_settings']['remaining_s'] <= 90


def test_a_port_in_use_is_one_line_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with listen('127.0.0.1:0') as taken:
        port = taken.getsockname()[1]
        output = refusal(page_node.main, monkeypatch, capfd, address=f'127.0.0.1:{port}')
    (line,) = output.strip().splitlines()
    assert line.startswith(f'error: page address 127.0.0.1:{port} is in use')
    assert '--page HOST:PORT' in line


def test_a_wrong_rig_is_one_line_and_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / 'rig.yaml'
    broken.write_text(RIG_FILE.read_text().replace('producer: producer', 'producer: pump9'))
    output = refusal(page_node.main, monkeypatch, capfd, address=free_address(), rig=broken)
    (line,) = output.strip().splitlines()
    assert "unknown well 'pump9'" in line


def test_an_interrupt_while_browsers_watch_ends_the_page_with_status_0() -> None:
    address = free_address()
    process = start_page(address, f'rig:={RIG_FILE}')
    until(lambda: newest_event(address)['panels']['node_health'], 'the names of the nodes')
    with urllib.request.urlopen(f'http://{address}/events', timeout=PATIENCE_S) as watching:
        watching.readline()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, output
    (line,) = output.strip().splitlines()
    assert f'page: http://{address}/#token=' in line


def test_an_interrupt_while_an_answer_is_awaited_ends_the_page(hub, tmp_path) -> None:
    address, asked, told = free_address(), threading.Event(), threading.Event()
    (tmp_path / 'token').write_text(TOKEN)

    def answer(_: AnswerMend.Request, response: AnswerMend.Response) -> AnswerMend.Response:
        asked.set()
        told.wait(LONGEST_ANSWER_S)
        return response

    def ask() -> None:
        while not asked.is_set():  # the page may not know the service yet
            with contextlib.suppress(OSError):
                post(address, {'sequence': 1, 'accept': True}, 'mend')

    hub.mend.create_service(AnswerMend, 'mend/answer', answer)
    with page(address, f'token_file:={tmp_path / "token"}') as process:
        until(lambda: newest_event(address), 'an event')
        asking = threading.Thread(target=ask)
        asking.start()
        assert asked.wait(PATIENCE_S)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=LONGEST_ANSWER_S / 2)
        assert process.returncode == 0, output
    told.set()
    asking.join()


def test_the_port_is_free_after_the_end_of_a_page() -> None:
    address = free_address()
    for _ in range(2):
        with page(address, f'rig:={RIG_FILE}'):
            event = until(lambda: newest_event(address), 'an event')
            assert event['header']['rig_name'] == RIG.name
