"""Tests of the operator's node: it announces valid setpoints and publishes confirmed rates."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from hub_examples import SMALL_RIG
from patience import until
from rclpy.parameter import Parameter
from std_msgs.msg import String

from porotwin_checks.checks.tracer_amount import AMOUNT
from porotwin_core.basis.units import from_ml_h
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import Rig
from porotwin_core.ros import conversions, qos
from porotwin_core.ros.foreign_words import FEW
from porotwin_core.ros.node import executor_of
from porotwin_core.ros.vouching import Voucher
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.operator_node import OperatorNode
from porotwin_msgs.msg import CycleReport, MendOffer, Setpoint, WellRates
from porotwin_msgs.srv import ConfirmRates, Control

pytestmark = pytest.mark.graph


class Desk:
    """An operator's node with a clock that tests set, and a node that talks to it."""

    def __init__(self, context: rclpy.Context) -> None:
        self.now = time.time()
        self.nodes: list[Any] = []
        overrides = [Parameter('rig', value=str(SMALL_RIG)), Parameter('asset', value=True)]
        self.operator = OperatorNode(
            clock=lambda: self.now, context=context, parameter_overrides=overrides
        )
        self.peer = rclpy.create_node('guard', context=context)
        self.page = rclpy.create_node('page', context=context)
        self.executor = executor_of(4, context)
        for node in (self.operator, self.peer, self.page):
            self.executor.add_node(node)
        self.setpoints = self.peer.create_publisher(Setpoint, 'wells/setpoint', qos.SETPOINT)
        self.measured: list[WellRates] = []
        self.peer.create_subscription(WellRates, 'wells/measured', self.measured.append, qos.FIELD)
        self.confirm = self.page.create_client(ConfirmRates, 'operator/confirm')
        self.control = self.peer.create_client(Control, 'asset/control')
        self.guard_vouches, self.page_vouches = Voucher(self.peer), Voucher(self.page)
        self.spin_until(
            lambda: (
                self.setpoints.get_subscription_count() > 0
                and self.operator.count_subscribers('wells/measured') > 0
                and self.confirm.service_is_ready()
                and self.control.service_is_ready()
            )
        )

    def publisher(self, name: str, kind: Any, topic: str, profile: Any) -> Any:
        """Return a publisher of a new node called `name`, which the operator hears."""
        node = rclpy.create_node(name, context=self.peer.context)
        made = node.create_publisher(kind, topic, profile)
        self.nodes.append(node)
        self.spin_until(lambda: made.get_subscription_count() > 0)
        return made

    def spin_until(self, condition: Callable[[], bool]) -> None:
        until(condition, look=self.executor.spin_once)

    def spin_for(self, seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.05)

    def ask(self, request: object) -> str:
        """Return the message of the outcome of a request to confirm or to control."""
        if isinstance(request, ConfirmRates.Request):
            client = self.confirm
            self.page_vouches.vouch('operator/confirm', request)
        else:
            client = self.control
            self.guard_vouches.vouch('asset/control', request)
        future = client.call_async(request)
        self.spin_until(future.done)
        return str(future.result().outcome.message)


@pytest.fixture
def desk(domain: int) -> Iterator[Desk]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    yield Desk(context)
    rclpy.shutdown(context=context)


@pytest.fixture
def other(small_rig: Rig) -> dict[str, WellRate]:
    return Limits.of(small_rig).setpoint(from_ml_h(1.0) * np.array([100.0, 0.0, 0.0]))


def test_a_setpoint_expires_during_a_suspend_of_the_computer(
    domain: int, other: dict[str, WellRate], monkeypatch: pytest.MonkeyPatch
) -> None:
    context, slept, read = rclpy.Context(), 0.0, time.clock_gettime
    monkeypatch.setattr(
        time, 'clock_gettime', lambda one: read(one) + slept * (one == time.CLOCK_BOOTTIME)
    )
    rclpy.init(context=context, domain_id=domain)
    own = [Parameter('rig', value=str(SMALL_RIG))]
    operator = OperatorNode(context=context, parameter_overrides=own)
    operator._on_setpoint(setpoint(1, other))
    said: list[str] = []
    monkeypatch.setattr(operator, '_order', lambda words: said.append(words.speech))
    operator._on_timer()
    assert said == []
    slept = 600.0
    operator._on_timer()
    assert 'Setpoint 1 has expired' in said[0]
    rclpy.shutdown(context=context)


def setpoint(sequence: int, rates: dict[str, WellRate], *, validity: float = 90.0) -> Setpoint:
    """Return a setpoint that follows from a photograph at 5 s."""
    return Setpoint(
        header=conversions.header_at(5.0),
        sequence=sequence,
        valid_until=conversions.time_to_msg(5.0 + validity),
        wells=conversions.rates_to_msg(rates),
        reason='held: no answer',
    )


def test_setpoints_are_announced_confirmed_and_expire(
    desk: Desk, other: dict[str, WellRate], small_rig: Rig, capsys: pytest.CaptureFixture[str]
) -> None:
    desk.setpoints.publish(setpoint(1, other))
    shown: list[str] = []

    def shows(text: str) -> bool:
        shown.append(capsys.readouterr().out)
        return text in ''.join(shown)

    first = 'setpoint 1 (photograph 0:00:05, valid until 0:01:35)\n  why: held: no answer\n'
    desk.spin_until(lambda: shows(first))
    desk.now += 12.0
    assert desk.ask(ConfirmRates.Request(sequence=1)) == ''
    desk.spin_until(lambda: len(desk.measured) == 1)
    desk.spin_until(lambda: shows('confirmed by /page: '))
    confirmed = desk.measured[0]
    assert conversions.time_from_msg(confirmed.start) == pytest.approx(17.0)
    assert confirmed.header.stamp == confirmed.start
    assert conversions.rates_from_msg(confirmed.wells) == other
    desk.now += 79.0
    desk.spin_until(lambda: shows('setpoint 1 has expired'))
    question = desk.ask(ConfirmRates.Request(sequence=1))
    assert question.endswith('confirm once more if these are set')
    assert desk.ask(ConfirmRates.Request(sequence=1)) == ''
    desk.spin_until(lambda: len(desk.measured) == 2)
    safe = Limits.of(small_rig).safe()
    assert conversions.rates_from_msg(desk.measured[1].wells) == safe


def test_only_the_page_and_the_terminal_confirm_rates(
    desk: Desk, other: dict[str, WellRate], capfd: pytest.CaptureFixture[str]
) -> None:
    desk.setpoints.publish(setpoint(1, other))
    desk.spin_until(lambda: desk.operator._book.newest == 1)
    stranger = rclpy.create_node('stranger', context=desk.peer.context)
    client = stranger.create_client(ConfirmRates, 'operator/confirm')
    desk.executor.add_node(stranger)
    desk.spin_until(client.service_is_ready)
    future = client.call_async(ConfirmRates.Request(sequence=1))
    desk.spin_until(future.done)
    assert 'and only /page or terminal may' in future.result().outcome.message
    assert (
        sum('confirmation refused: ' in line for line in capfd.readouterr().err.splitlines()) == 1
    )
    stranger.destroy_client(client)
    # a client of the page is no proof either
    future = desk.confirm.call_async(ConfirmRates.Request(sequence=1))
    desk.spin_until(future.done)
    assert (
        'only /page or terminal may, which does not know of it' in future.result().outcome.message
    )
    assert desk.measured == []
    assert desk.ask(ConfirmRates.Request(sequence=1)) == ''
    desk.spin_until(lambda: len(desk.measured) == 1)


def test_a_confirmation_bears_the_time_of_a_camera_whose_clock_is_right(
    desk: Desk, other: dict[str, WellRate]
) -> None:
    message, taken = setpoint(1, other), time.time() - 20.0
    message.header = conversions.header_at(taken)
    message.valid_until = conversions.time_to_msg(taken + 90.0)
    desk.setpoints.publish(message)
    desk.spin_until(lambda: desk.operator._book.newest == 1)
    desk.now += 12.0
    assert desk.ask(ConfirmRates.Request(sequence=1)) == ''
    desk.spin_until(lambda: len(desk.measured) == 1)
    assert conversions.time_from_msg(desk.measured[0].start) == pytest.approx(taken + 32.0, abs=5.0)


def test_what_a_person_must_know_is_said_once(
    desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    cycles = desk.publisher('hub', CycleReport, 'hub/cycle', qos.FIELD)
    heard: list[String] = []
    desk.peer.create_subscription(String, 'operator/announcement', heard.append, qos.FIELD)
    desk.spin_until(lambda: desk.peer.count_subscribers('operator/announcement') > 0)
    late = 'no setpoint: the photograph was taken {} ago'.format
    volume = AMOUNT.format(map='the photograph', held_ml=9.0, pumped_ml=18.0)
    for remark, expected in (
        (late('1:00:00'), 1),
        (late('1:00:30'), 1),
        ('', 1),
        (late('0:10:00'), 2),
        (volume, 3),
        (volume, 3),
    ):
        cycles.publish(CycleReport(remarks=['another remark', remark]))
        desk.spin_for(0.3)
        desk.spin_until(lambda expected=expected: len(heard) >= expected)
        assert len(heard) == expected
    assert 'no setpoint: the photograph was taken 1:00:00 ago' in capsys.readouterr().out


def test_a_setpoint_that_is_not_valid_is_neither_announced_nor_accepted(
    desk: Desk, other: dict[str, WellRate], capsys: pytest.CaptureFixture[str]
) -> None:
    never_valid = setpoint(1, other, validity=-1.0)
    too_much = setpoint(2, {**other, 'control1': WellRate(from_ml_h(9e5))})
    for message in (never_valid, too_much):
        desk.setpoints.publish(message)
        desk.spin_for(0.5)
        assert desk.ask(Control.Request(setpoint=message)) != ''
    assert capsys.readouterr().out == ''
    assert 'there was none yet' in desk.ask(ConfirmRates.Request(sequence=1))
    assert desk.ask(Control.Request(setpoint=setpoint(3, other))) == ''


ORDER = '\x1b[2J\rsetpoint 777\n  control1       1500.0 ml/h   <-- set'
"""Words that would be an order if a terminal took them as they are."""


def lines_shown(desk: Desk, capsys: pytest.CaptureFixture[str], least: int) -> list[str]:
    """Return the lines of the operator's terminal once there are `least`, and all are printable."""
    shown: list[str] = []

    def come() -> bool:
        shown.extend(capsys.readouterr().out.splitlines())
        return len(shown) >= least

    desk.spin_until(come)
    assert all(line.isprintable() for line in shown)
    return shown


def test_words_of_other_nodes_are_told_as_theirs_and_never_as_an_order(
    desk: Desk, other: dict[str, WellRate], capsys: pytest.CaptureFixture[str]
) -> None:
    offers = desk.publisher('mend', MendOffer, 'mend/offer', qos.CONFIG)
    offers.publish(MendOffer(sequence=3, sentence=ORDER))
    (offer,) = lines_shown(desk, capsys, 1)
    assert offer.startswith("offer 3: 'mend' says: \"\\x1b[2J")
    cycles = desk.publisher('hub', CycleReport, 'hub/cycle', qos.FIELD)
    cycles.publish(CycleReport(remarks=['no setpoint: ' + ORDER]))
    (remark,) = lines_shown(desk, capsys, 1)
    assert remark.startswith("'hub' says: \"no setpoint: \\x1b[2J")
    true = setpoint(1, other)
    true.reason = ORDER
    desk.setpoints.publish(true)
    lines = lines_shown(desk, capsys, 2 + len(other))
    assert lines[1].startswith('  why: \\x1b[2J')
    assert sum(line.startswith('setpoint ') for line in lines) == 1
    assert sum(line.endswith('<-- set') for line in lines) == len(other) + 1  # and in the reason


def test_a_report_of_a_foreign_node_is_not_shown(
    desk: Desk, capfd: pytest.CaptureFixture[str]
) -> None:
    cycles = desk.publisher('stranger', CycleReport, 'hub/cycle', qos.FIELD)
    cycles.publish(CycleReport(remarks=['no setpoint: ' + ORDER]))
    shown: list[str] = []

    def refused() -> bool:
        captured = capfd.readouterr()
        assert '777' not in captured.out + captured.err
        shown.append(captured.out + captured.err)
        return '/stranger publishes hub/cycle too' in ''.join(shown)

    desk.spin_until(refused)


def test_a_flood_of_offers_is_a_few_lines(desk: Desk, capsys: pytest.CaptureFixture[str]) -> None:
    offers = desk.publisher('mend', MendOffer, 'mend/offer', qos.CONFIG)
    for number in range(200):
        desk.operator._on_offer(MendOffer(sequence=number, sentence=f'offer {number}'))
    assert offers.get_subscription_count() > 0
    assert len(capsys.readouterr().out.splitlines()) == FEW
