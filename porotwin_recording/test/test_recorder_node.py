"""Tests of the recorder node in a running graph."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import pytest
import rclpy
from node_processes import Process, by_topic, node, write_minute_bag
from patience import until
from rclpy.publisher import Publisher
from refused_node import refusal
from std_msgs.msg import Header

from porotwin_core.ros import qos
from porotwin_core.ros.senders import SENDERS
from porotwin_msgs.msg import WellRates
from porotwin_recording import recorder_node
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.topic_names import DOUBTFUL, MEASURED, TYPES

pytestmark = pytest.mark.graph

PUBLISHER = """
import sys, time
import rclpy
from rclpy.qos import QoSProfile
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('talker')
latched = node.create_publisher(
    String, 'latched', QoSProfile(depth=3, durability=DurabilityPolicy.TRANSIENT_LOCAL))
for word in 'abc':
    latched.publish(String(data=word))
quick = node.create_publisher(String, 'quick', 5000)
loose = node.create_publisher(
    String, 'loose', QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
node.create_publisher(String, '_hidden', 1).publish(String())
print('ready', flush=True)
while not (quick.get_subscription_count() and loose.get_subscription_count()):
    time.sleep(0.02)
time.sleep(1.0)  # the recorder may discover this node later than this node the recorder
for number in range(5000):
    quick.publish(String(data=str(number)))
    if number % 5 == 0:
        time.sleep(0.001)
    if number % 100 == 0:
        loose.publish(String(data=str(number)))
quick.wait_for_all_acked(rclpy.duration.Duration(seconds=20))
time.sleep(0.5)
print('done', flush=True)
time.sleep(60)
"""


SETPOINT, STRING = 'porotwin_msgs/msg/Setpoint', 'std_msgs/msg/String'

SENDER = """
import sys, time
import rclpy
from rclpy.qos import qos_profile_sensor_data
from porotwin_recording.mcap.interfaces import message_class
name, kind, first_topic = sys.argv[1:]
rclpy.init()
node = rclpy.create_node(name, namespace='porotwin')
kind = message_class(kind)
publishers = [node.create_publisher(kind, topic, qos_profile_sensor_data)
              for topic in (first_topic, 'words')]
print('ready', flush=True)
while True:
    for publisher in publishers:
        publisher.publish(kind())
    time.sleep(0.02)
"""


@contextmanager
def sender(log: Path, name: str, kind: str, topic: str = 'wells/setpoint') -> Iterator[Process]:
    process = Process(log, ['-c', SENDER, name, kind, topic])
    try:
        process.wait_for_output('ready')
        yield process
    finally:
        process.stop(signal.SIGKILL)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_minute_bag(tmp_path_factory.mktemp('minute'))


def test_a_killed_recorder_leaves_all_flushed_messages(tmp_path: Path, bag: Path) -> None:
    output = tmp_path / 'recorded'
    with (
        node(
            tmp_path / 'recorder.log', 'recorder_node', output=output, use_sim_time=True
        ) as recorder,
        node(tmp_path / 'player.log', 'player_node', bag=bag, rate=20.0, topics='all', loop=True),
    ):
        file = output / 'recorded_0.mcap'
        until(lambda: file.is_file() and file.stat().st_size > 3_000_000)
        recorder.stop(signal.SIGKILL)
    recorded = BagReader(output)
    assert 'has no end' in recorded.remarks[-1]
    original = by_topic(BagReader(bag).messages())
    found = by_topic(recorded.messages())
    for topic in ('/porotwin/asset/new_state', '/porotwin/camera/image/compressed'):
        assert found[topic]
        assert found[topic] == (original[topic] * 9)[: len(found[topic])]


def test_a_restarted_recorder_continues_in_the_same_bag(tmp_path: Path) -> None:
    output = tmp_path / 'bag'
    for name in ('bag_0.mcap', 'bag_1.mcap'):
        with node(
            tmp_path / 'recorder.log', 'recorder_node', output=output, continues=True
        ) as recorder:
            recorder.wait_for_output(f'recording into {output / name}\n')
            recorder.stop(signal.SIGKILL if name == 'bag_0.mcap' else signal.SIGINT)
    (remark,) = BagReader(output).remarks
    assert 'bag_0.mcap: has no end' in remark


def test_ctrl_c_during_the_start_ends_the_recorder(tmp_path: Path) -> None:
    code = (
        'from porotwin_recording import recorder_node\n'
        'def pressed(_): raise KeyboardInterrupt\n'
        'recorder_node.RecorderNode._discover = pressed\n'
        'recorder_node.main()'
    )
    output = tmp_path / 'recorded'
    recorder = Process(
        tmp_path / 'recorder.log', ['-c', code, '--ros-args', '-p', f'output:={output}']
    )
    try:
        assert recorder.popen.wait(timeout=60) == 0, recorder.output
    finally:
        recorder.stop(signal.SIGKILL)
    assert BagReader(output).message_count == 0


def test_a_terminated_recorder_completes_the_bag(tmp_path: Path) -> None:
    output = tmp_path / 'recorded.mcap'
    with node(tmp_path / 'recorder.log', 'recorder_node', output=output) as recorder:
        recorder.wait_for_output('recording into')
        assert recorder.stop(signal.SIGTERM) == 0
    assert BagReader(output).remarks == []


def test_a_live_graph_is_recorded_without_loss(tmp_path: Path) -> None:
    talker = Process(tmp_path / 'talker.log', ['-c', PUBLISHER])
    try:
        talker.wait_for_output('ready')
        with node(tmp_path / 'rec.log', 'recorder_node', output=tmp_path / 'run') as recorder:
            talker.wait_for_output('done')
            assert recorder.stop() == 0
    finally:
        talker.stop(signal.SIGKILL)
    bag = BagReader(tmp_path / 'run')
    words = {
        name: [bag.decode(message).data for message in bag.messages([name])]
        for name in ('/latched', '/quick', '/loose')
    }
    assert words['/latched'] == ['a', 'b', 'c']
    assert words['/quick'] == [str(number) for number in range(5000)]
    assert words['/loose']
    assert '/_hidden' not in bag.topics
    assert bag.topics['/loose'].qos.reliability == 'best_effort'
    numbers = [message.sequence for message in bag.messages(['/quick'])]
    assert numbers == list(range(numbers[0], numbers[0] + 5000))


def wait_for_more(bag: Path) -> None:
    """Return when the file of a bag has grown twice: the second time by words from now on."""
    file = bag / f'{bag.name}_0.mcap'
    for _ in range(2):
        size = file.stat().st_size
        until(lambda size=size: file.stat().st_size > size)


def test_a_passing_sender_of_another_type_ends_no_recording(tmp_path: Path) -> None:
    output = tmp_path / 'run'
    with (
        sender(tmp_path / 'guard.log', 'guard', SETPOINT),
        node(tmp_path / 'rec.log', 'recorder_node', output=output) as recorder,
    ):
        recorder.wait_for_output('recording into')
        until(lambda: (output / 'run_0.mcap').stat().st_size > 2000)
        with sender(tmp_path / 'stranger.log', 'stranger', STRING) as stranger:
            recorder.wait_for_output('/porotwin/wells/setpoint carries std_msgs/msg/String too')
            recorder.wait_for_output('/porotwin/words carries std_msgs/msg/String too')
            beside = time.time_ns()
            wait_for_more(output)
            stranger.stop()
        left = time.time_ns()
        wait_for_more(output)
        assert recorder.stop() == 0, recorder.output
    bag = BagReader(output)
    for name in ('/porotwin/wells/setpoint', '/porotwin/words'):
        assert bag.topics[name].type_name == SETPOINT
        assert f'{name}/{DOUBTFUL}' not in bag.topics
        times = [message.log_time for message in bag.messages([name])]
        assert any(beside < one < left for one in times)
        assert times[-1] > left


def test_a_topic_of_the_twin_is_recorded_with_its_type_whoever_comes_first(tmp_path: Path) -> None:
    with (
        sender(tmp_path / 'stranger.log', 'stranger', STRING),
        node(tmp_path / 'rec.log', 'recorder_node', output=tmp_path / 'run') as recorder,
    ):
        recorder.wait_for_output('/porotwin/wells/setpoint carries std_msgs/msg/String too')
        with sender(tmp_path / 'guard.log', 'guard', SETPOINT):
            until(lambda: (tmp_path / 'run' / 'run_0.mcap').stat().st_size > 9000)
        assert recorder.stop() == 0, recorder.output
    bag = BagReader(tmp_path / 'run')
    assert bag.topics['/porotwin/wells/setpoint'].type_name == SETPOINT
    assert f'/porotwin/wells/setpoint/{DOUBTFUL}' not in bag.topics
    assert list(bag.messages(['/porotwin/wells/setpoint']))


FLOOD = """
import time
import rclpy
from porotwin_msgs.msg import Setpoint
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node('stranger', namespace='porotwin')
publishers = {kind: node.create_publisher(kind, topic, qos_profile_sensor_data) for topic, kind in
              (('flood', String), ('wells/setpoint', Setpoint))}
print('ready', flush=True)
for _ in range(200):
    publishers[String].publish(String(data='x' * 1_000_000))
    publishers[Setpoint].publish(Setpoint(reason='x' * 300_000))
    time.sleep(0.05)
"""


def test_no_flood_fills_the_bag(tmp_path: Path) -> None:
    flood = Process(tmp_path / 'flood.log', ['-c', FLOOD])
    with (
        sender(tmp_path / 'guard.log', 'guard', SETPOINT),
        node(
            tmp_path / 'rec.log',
            'recorder_node',
            output=tmp_path / 'run',
            others_mb_s=1.0,
            compress=False,
        ) as recorder,
    ):
        for topic in ('/porotwin/flood', f'/porotwin/wells/setpoint/{DOUBTFUL}'):
            recorder.wait_for_output(f'{topic} is not recorded any more: topics that are not')
        flood.stop()
        ended = time.time_ns()
        wait_for_more(tmp_path / 'run')
        assert recorder.stop() == 1, recorder.output  # not all is in the bag
    bag = BagReader(tmp_path / 'run')
    sizes = {name: sum(len(one.data) for one in bag.messages([name])) for name in bag.topics}
    assert sum(sizes.values()) < 20e6
    assert max(one.log_time for one in bag.messages(['/porotwin/wells/setpoint'])) > ended
    assert max(one.log_time for one in bag.messages(['/porotwin/words'])) > ended


def test_measured_rates_that_a_stranger_could_have_sent_are_set_aside(
    tmp_path: Path, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    pumps, stranger = (
        rclpy.create_node(name, namespace='/porotwin', context=context)
        for name in ('pumps', 'stranger')
    )
    true = pumps.create_publisher(WellRates, 'wells/measured', qos.FIELD)

    def tell(publisher: Publisher, frame: str) -> None:
        until(publisher.get_subscription_count)
        publisher.publish(WellRates(header=Header(frame_id=frame)))
        assert publisher.wait_for_all_acked()

    name = f'/porotwin/{MEASURED}'

    def frames(topic: str) -> list[str]:
        bag = BagReader(tmp_path / 'run')
        return [bag.decode(one).header.frame_id for one in bag.messages([topic])]

    def wait_for_a_true_one() -> None:
        """Tell true rates until some are kept; those before an end was noticed are set aside."""
        before = len(frames(name))
        until(lambda: tell(true, 'true') or len(frames(name)) > before, look=lambda _: sleep(0.3))

    with node(tmp_path / 'rec.log', 'recorder_node', output=tmp_path / 'run') as recorder:
        recorder.wait_for_output('recording into')
        for number in range(1, 4):
            wait_for_a_true_one()
            brief = stranger.create_publisher(WellRates, 'wells/measured', qos.FIELD)
            tell(brief, 'forged')
            stranger.destroy_publisher(brief)
            until(lambda told=number: frames(f'{name}/{DOUBTFUL}').count('forged') == told)
        wait_for_a_true_one()
        assert recorder.stop() == 0, recorder.output
    rclpy.shutdown(context=context)
    assert set(frames(name)) == {'true'}
    (remark,) = BagReader(tmp_path / 'run').remarks
    assert f'{len(frames(f"{name}/{DOUBTFUL}"))} messages of {name} were set aside' in remark


def test_the_types_of_all_topics_whose_sender_matters_are_known() -> None:
    assert set(TYPES) == {topic for topic in SENDERS if not topic.endswith('/_vouched')}


@pytest.mark.parametrize(
    ('parameters', 'complaint'),
    [
        ({}, "parameter 'output' of recorder: name the bag to write"),
        ({'output': '{bag}'}, 'exists already; name another bag'),
        ({'output': '{bag}_new', 'split_mb': '.inf'}, "'split_mb' of recorder is inf; give a"),
    ],
)
def test_wrong_recorder_parameters_end_with_one_line(
    bag: Path,
    parameters: dict[str, object],
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    parameters = {key: str(value).format(bag=bag) for key, value in parameters.items()}
    output = refusal(recorder_node.main, monkeypatch, capfd, **parameters)
    assert complaint in output
    assert 'Traceback' not in output
