"""The virtual rig and the mock camera as real processes; this test plays the twin over DDS."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from patience import PATIENCE_S, until
from refused_node import refusal
from rig_examples import make_rig, rates

from porotwin_core.basis.units import to_ml_h
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import load_rig, write_rig
from porotwin_recording.tables.concentration import open_maps
from porotwin_rig.made_experiment import make_experiment
from porotwin_rig.virtual_rig import VirtualRig

rclpy = pytest.importorskip('rclpy', reason='needs ROS 2; set it up with ./porotwin')

from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import CompressedImage  # noqa: E402

from porotwin_core.ros import (  # noqa: E402
    conversions,
    qos,
)
from porotwin_core.ros.node_thread import NodeThread  # noqa: E402
from porotwin_core.ros.vouching import Voucher  # noqa: E402
from porotwin_msgs.msg import CleanState, Outcome, Setpoint, WellRates  # noqa: E402
from porotwin_msgs.srv import Control, Ping  # noqa: E402
from porotwin_rig import virtual_rig_node  # noqa: E402

pytestmark = pytest.mark.graph


class Twin:
    """Plays the twin: keeps all messages in order, answers photographs with setpoints."""

    def __init__(self, answers: dict[float, dict[str, Any]], namespace: str = '/porotwin') -> None:
        self.messages: list[tuple[str, float, Any]] = []
        self.sent: list[tuple[int, str, float]] = []
        self.outcomes: dict[float, Outcome] = {}
        self.finished = threading.Event()
        self._answers = answers
        context = rclpy.Context()
        rclpy.init(context=context)
        self.node = rclpy.create_node('guard', namespace=namespace, context=context)
        self._control = self.node.create_client(Control, 'asset/control')
        self._voucher = Voucher(self.node)
        self.ping = self.node.create_client(Ping, 'asset/ping')
        listen = self.node.create_subscription
        listen(CompressedImage, 'camera/image/compressed', self._on_photo, qos.PHOTO)
        listen(
            CompressedImage,
            'camera/baseline/compressed',
            lambda message: self._keep('baseline', message),
            qos.BASELINE,
        )
        listen(WellRates, 'wells/measured', self._on_rates, qos.FIELD)
        listen(Clock, '/clock', self._on_clock, 10)
        listen(CleanState, 'asset/clean_state', self._on_clean, qos.FIELD)
        self._thread = NodeThread(self.node)

    def close(self) -> None:
        self._thread.end()

    def _keep(self, kind: str, message: Any) -> None:
        self.messages.append((kind, conversions.time_from_msg(message.header.stamp), message))

    def _on_clock(self, message: Clock) -> None:
        self.messages.append(('clock', conversions.time_from_msg(message.clock), message))

    def _on_clean(self, message: CleanState) -> None:
        self._keep('clean', message)
        self.finished.set()

    def _on_rates(self, message: WellRates, info: Any) -> None:
        self._keep('rates', message)
        self.sent.append((info['source_timestamp'], 'rates', self.messages[-1][1]))

    def _on_photo(self, message: CompressedImage, info: Any) -> None:
        self._keep('photo', message)
        self.sent.append((info['source_timestamp'], 'photo', self.messages[-1][1]))
        stamp = conversions.time_from_msg(message.header.stamp)
        if stamp not in self._answers:
            return
        setpoint = Setpoint(
            header=message.header,
            sequence=len(self.messages),
            valid_until=conversions.time_to_msg(stamp + 45.0),
            wells=conversions.rates_to_msg(self._answers[stamp]),
        )

        request = Control.Request(setpoint=setpoint)
        self._voucher.vouch('asset/control', request)

        def keep(future: Any) -> None:
            self.outcomes[stamp] = future.result().outcome

        self._control.call_async(request).add_done_callback(keep)

    def of(self, kind: str) -> list[tuple[float, Any]]:
        return [(stamp, message) for found, stamp, message in self.messages if found == kind]


def start(
    module: str, namespace: str = '/porotwin', **parameters: object
) -> subprocess.Popen[bytes]:
    soon = f'from porotwin_rig import {module} as node; node.SETTLE_S = 1.0; node.main()'
    command = [sys.executable, '-c', soon, '--ros-args', '-r', f'__ns:={namespace}']
    for name, value in parameters.items():
        command += ['-p', f'{name}:={value}']
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def end(process: subprocess.Popen[bytes]) -> str:
    try:
        output, _ = process.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        output, _ = process.communicate()
    return output.decode()


GOOD = rates(injector=(500.0, 1.0), control1=200.0, producer=-700.0)
TOO_MUCH = rates(injector=(500.0, 1.0), control1=900.0, producer=-1400.0)


@pytest.fixture(scope='module')
def lock_step(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Twin, str, Path]]:
    """A run of two minutes; the answer to the photograph at 60 s is wrong, at 90 s missing."""
    folder = tmp_path_factory.mktemp('asset')
    write_rig(make_rig(), folder / 'rig.yaml')
    twin = Twin({0.0: GOOD, 30.0: GOOD, 60.0: TOO_MUCH, 120.0: GOOD})
    process = start(
        'virtual_rig_node',
        rig=folder / 'rig.yaml',
        duration_s=120.0,
        photo_width_px=320,
        lock_step_timeout_s=3.0,
        wait_for_services='asset/ping',
        truth=folder / 'truth.nc',
        grid='60x40',
    )
    until(lambda: twin.of('photo'))
    assert twin.ping.wait_for_service(PATIENCE_S)
    answer = twin.ping.call_async(Ping.Request())
    twin.finished.wait(PATIENCE_S)
    output = end(process)
    assert process.returncode == 0, output
    assert answer.result().name == 'virtual rig'
    yield twin, output, folder
    twin.close()


def test_photographs_come_in_order_after_the_rates_that_led_to_them(
    lock_step: tuple[Twin, str, Path],
) -> None:
    twin, _, _ = lock_step
    assert [stamp for stamp, _ in twin.of('photo')] == [0.0, 30.0, 60.0, 90.0, 120.0]
    assert [stamp for stamp, _ in twin.of('rates')] == [30.0, 60.0, 90.0, 120.0]
    # two topics arrive in any order, so the order of sending counts
    kinds = [(kind, stamp) for _, kind, stamp in sorted(twin.sent)]
    assert kinds == sorted(kinds, key=lambda item: (item[1], item[0] == 'photo'))
    assert len(twin.of('baseline')) == 1
    photo = twin.of('photo')[0][1]
    assert photo.header.frame_id == 'camera_optical'
    assert bytes(photo.data[:2]) == b'\xff\xd8'


def test_clock_never_goes_back_and_reaches_the_end(lock_step: tuple[Twin, str, Path]) -> None:
    times = [stamp for stamp, _ in lock_step[0].of('clock')]
    assert times == sorted(times)
    assert times[-1] == 120.0


def test_setpoint_is_pumped_from_its_photograph_on(lock_step: tuple[Twin, str, Path]) -> None:
    twin, _, _ = lock_step
    control1 = {
        stamp: to_ml_h(conversions.rates_from_msg(message.wells)['control1'].rate)
        for stamp, message in twin.of('rates')
    }
    # the setpoint of 30 s holds until 75 s; the refused one changes nothing; then safe rates
    assert control1 == pytest.approx({30.0: 200.0, 60.0: 200.0, 90.0: 100.0, 120.0: 0.0})
    producer = conversions.rates_from_msg(twin.of('rates')[0][1].wells)['producer']
    assert to_ml_h(producer.rate) == pytest.approx(-0.99 * 700.0)


def test_setpoint_beyond_the_limits_is_refused_with_a_reason(
    lock_step: tuple[Twin, str, Path],
) -> None:
    twin, output, _ = lock_step
    assert twin.outcomes[30.0].code == Outcome.OK
    assert twin.outcomes[60.0].code == Outcome.INVALID_INPUT
    assert "'control1'" in twin.outcomes[60.0].message
    assert output.count('refused') == 1
    assert 'no setpoint for the photograph at 90 s' in output


def test_the_end_of_the_experiment_is_announced(lock_step: tuple[Twin, str, Path]) -> None:
    stamp, message = lock_step[0].of('clean')[-1]
    assert stamp == 120.0
    assert message.cause == CleanState.FINISHED


def test_truth_is_kept_for_every_photograph(lock_step: tuple[Twin, str, Path]) -> None:
    _, _, folder = lock_step
    maps = open_maps(folder / 'truth.nc', load_rig(folder / 'rig.yaml'))
    np.testing.assert_array_equal(maps.times, [0.0, 30.0, 60.0, 90.0, 120.0])
    assert maps[0].max() == 0.0
    assert maps[-1].sum() > maps[1].sum() > 0.0


@pytest.mark.parametrize(
    ('parameters', 'complaint'),
    [
        ({'effects': 'magnetism'}, "'magnetism' is not known"),
        ({'speed': 'quick'}, "speed 'quick'"),
        ({'duration_s': -1.0}, 'duration_s'),
        ({'seed': -1}, "'seed' of virtual_rig is -1"),
        ({'photo_width_px': 0}, "'photo_width_px' of virtual_rig is 0"),
    ],
)
def test_wrong_parameter_ends_with_one_line(
    tmp_path: Path,
    parameters: dict[str, object],
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    rig_file = tmp_path / 'rig.yaml'
    write_rig(make_rig(), rig_file)
    output = refusal(virtual_rig_node.main, monkeypatch, capfd, rig=rig_file, **parameters)
    lines = [line for line in output.splitlines() if line.strip()]
    assert len(lines) == 1
    assert complaint in lines[0]


def test_mock_camera_publishes_a_folder_with_its_faults(tmp_path: Path) -> None:
    make_experiment(
        tmp_path / 'run',
        VirtualRig(make_rig()),
        commanded=Schedule.from_rates([(0.0, GOOD)]),
        duration=120.0,
        photo_interval=30.0,
        seed=2,
        photo_width_px=320,
    )
    # a name of its own: the camera must not take the other test's twin for its listener
    twin = Twin({}, namespace='/mock')
    process = start(
        'mock_camera_node',
        namespace='/mock',
        photos=tmp_path / 'run',
        period_s=0.2,
        faults='1:truncated,2:duplicate,3:missing',
    )
    until(lambda: len(twin.of('photo')) == 4 and twin.of('baseline'))
    output = end(process)
    photos = twin.of('photo')
    twin.close()
    assert process.returncode == 0, output
    assert [stamp for stamp, _ in photos] == [30.0, 60.0, 90.0, 90.0]
    assert len(photos[1][1].data) < 0.7 * len(photos[0][1].data)
    assert len(twin.of('baseline')) == 1
