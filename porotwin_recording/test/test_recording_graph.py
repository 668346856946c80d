"""Recorder and player over real DDS, every node in a process of its own."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from porotwin_core.rig import Rig, Well
from porotwin_core.wells import Schedule, WellRate
from porotwin_recording.bag_reader import BagMessage, BagReader
from porotwin_recording.concentration import ConcentrationMaps
from porotwin_recording.convert import IMPORT_START, import_experiment
from porotwin_recording.experiment import write_experiment
from porotwin_recording.photos import Photo
from porotwin_recording.serialization import SECOND

pytestmark = pytest.mark.graph

FRAMES = 30


def eventually(condition: Callable[[], bool], timeout: float = 60.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


class Process:
    """A node in a process of its own, whose output can be waited for."""

    def __init__(self, log: Path, arguments: list[str]) -> None:
        self.log = log
        with log.open('w') as output:
            self.popen = subprocess.Popen(
                [sys.executable, *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    @property
    def output(self) -> str:
        return self.log.read_text()

    def wait_to_say(self, text: str) -> None:
        assert eventually(lambda: text in self.output or self.popen.poll() is not None)
        assert text in self.output, self.output

    def stop(self, number: int = signal.SIGINT) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(number)
        return self.popen.wait(timeout=60)


@contextmanager
def node(log: Path, name: str, **parameters: object) -> Iterator[Process]:
    arguments = ['-m', f'porotwin_recording.{name}', '--ros-args', '-r', '__ns:=/porotwin']
    for key, value in parameters.items():
        arguments += ['-p', f'{key}:={value}']
    process = Process(log, arguments)
    try:
        yield process
    finally:
        process.stop(signal.SIGKILL)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A minute of states, photographs and rates, a state every two seconds."""
    rig = Rig(
        name='bench',
        width_m=0.4,
        height_m=0.3,
        depth_m=0.01,
        porosity=0.375,
        permeability_m2=6.57e-10,
        viscosity_pa_s=1e-3,
        density_kg_m3=998.0,
        wells={'in': Well(x_m=0.1, z_m=0.1)},
    )
    grid = rig.grid(187, 112)
    generator = np.random.default_rng(731)
    frames = generator.random((FRAMES, *grid.shape), dtype=np.float32)
    images = [b'\xff\xd8' + generator.bytes(200_000) for _ in range(FRAMES)]
    write_experiment(
        tmp_path / 'experiment',
        rig=rig,
        told=Schedule.constant({'in': WellRate(1e-7, 1.0)}),
        maps=ConcentrationMaps(np.arange(FRAMES) * 2.0, grid, lambda a, b: frames[a:b]),
        photos=[
            Photo(
                2.0 * number,
                'state' if number else 'baseline',
                f'photos/{number}.jpg',
                lambda image=image: image,
            )
            for number, image in enumerate(images)
        ],
    )
    import_experiment(tmp_path / 'experiment', tmp_path / 'bag')
    return tmp_path / 'bag'


def by_topic(messages: Iterator[BagMessage]) -> dict[str, list[bytes]]:
    found: dict[str, list[bytes]] = {}
    for message in messages:
        found.setdefault(message.topic, []).append(message.data)
    return found


def record(tmp_path: Path, bag: Path, **parameters: object) -> BagReader:
    """Play `bag` to a recorder and return what it recorded."""
    output = tmp_path / 'recorded'
    with (
        node(tmp_path / 'recorder.log', 'recorder_node', output=output, use_sim_time=True) as rec,
        node(tmp_path / 'player.log', 'player_node', bag=bag, discovery_s=20.0, **parameters) as p,
    ):
        assert p.popen.wait(timeout=100) == 0, p.output
        assert eventually(lambda: 'played' in p.output)
        assert rec.stop() == 0, rec.output
        assert ' 0 lost' in rec.output
    return BagReader(output)


def test_a_recorded_replay_is_the_recording(tmp_path: Path, bag: Path) -> None:
    recorded = record(tmp_path, bag, rate=0.0, topics='all')
    original = by_topic(BagReader(bag).messages())
    found = by_topic(recorded.messages())
    for topic, messages in original.items():
        assert found[topic] == messages, topic
        assert recorded.topics[topic].qos.latched == BagReader(bag).topics[topic].qos.latched
        assert recorded.topics[topic].definition == BagReader(bag).topics[topic].definition
    assert recorded.remarks == []


def test_a_replay_from_the_middle_has_the_clock_and_the_latched_topics(
    tmp_path: Path, bag: Path
) -> None:
    recorded = record(tmp_path, bag, rate=20.0, start_s=30.0, topics='all')
    assert recorded.topics['/porotwin/rig/description'].message_count == 1
    assert recorded.topics['/porotwin/asset/new_state'].message_count == FRAMES - 15
    clock = [
        int(time.clock.sec) * SECOND + int(time.clock.nanosec)
        for time in (recorded.decode(message) for message in recorded.messages(['/clock']))
    ]
    assert clock == sorted(clock)
    assert clock[0] >= IMPORT_START + 30 * SECOND
    assert clock[-1] == IMPORT_START + 2 * (FRAMES - 1) * SECOND
    # simulated time stands in the log times: the recorder follows the clock of the replay
    assert recorded.start_time >= IMPORT_START + 30 * SECOND
    assert recorded.end_time <= IMPORT_START + 2 * FRAMES * SECOND


def test_only_the_inputs_of_the_twin_are_played_unless_told_otherwise(
    tmp_path: Path, bag: Path
) -> None:
    recorded = record(tmp_path, bag, rate=0.0)
    played = {name for name, topic in recorded.topics.items() if topic.message_count}
    assert {name for name in played if name.startswith('/porotwin')} == {
        '/porotwin/camera/image/compressed',
        '/porotwin/camera/baseline/compressed',
        '/porotwin/wells/measured',
    }


def test_a_killed_recorder_leaves_what_it_flushed(tmp_path: Path, bag: Path) -> None:
    output = tmp_path / 'recorded'
    with (
        node(tmp_path / 'recorder.log', 'recorder_node', output=output) as recorder,
        node(tmp_path / 'player.log', 'player_node', bag=bag, rate=20.0, topics='all', loop=True),
    ):
        file = output / 'recorded_0.mcap'
        assert eventually(lambda: file.is_file() and file.stat().st_size > 3_000_000)
        recorder.stop(signal.SIGKILL)
    recorded = BagReader(output)
    assert 'has no end' in recorded.remarks[-1]
    original = by_topic(BagReader(bag).messages())
    found = by_topic(recorded.messages())
    for topic in ('/porotwin/asset/new_state', '/porotwin/camera/image/compressed'):
        assert found[topic]
        assert found[topic] == (original[topic] * 9)[: len(found[topic])]


def test_a_recorder_that_died_goes_on_beside_its_bag(tmp_path: Path) -> None:
    output = tmp_path / 'bag'
    for name in ('bag', 'bag_2'):
        with node(
            tmp_path / 'recorder.log', 'recorder_node', output=output, continues=True
        ) as recorder:
            recorder.wait_to_say(f'recording into {tmp_path / name}\n')
            recorder.stop(signal.SIGKILL if name == 'bag' else signal.SIGINT)
    assert 'has no end' in BagReader(output).remarks[0]
    assert BagReader(tmp_path / 'bag_2').remarks == []


def test_a_recorder_told_to_end_completes_the_bag(tmp_path: Path) -> None:
    output = tmp_path / 'recorded.mcap'
    with node(tmp_path / 'recorder.log', 'recorder_node', output=output) as recorder:
        recorder.wait_to_say('recording into')
        assert recorder.stop(signal.SIGTERM) == 0
    assert BagReader(output).remarks == []


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
time.sleep(1.0)  # seen by us, the recorder need not have seen us yet
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


def test_a_live_graph_is_recorded_whole(tmp_path: Path) -> None:
    talker = Process(tmp_path / 'talker.log', ['-c', PUBLISHER])
    try:
        talker.wait_to_say('ready')
        with node(tmp_path / 'rec.log', 'recorder_node', output=tmp_path / 'run') as recorder:
            talker.wait_to_say('done')
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


ANSWERER = """
import time
import rclpy
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import CompressedImage
rclpy.init()
node = rclpy.create_node('answerer', namespace='/porotwin')
publisher = node.create_publisher(PointStamped, 'hub/cycle', 1)
seen = []
def answer(photo):
    time.sleep(0.05)
    seen.append(photo.header.stamp.sec)
    print('seen', len(seen), flush=True)
    publisher.publish(PointStamped(header=photo.header))
node.create_subscription(CompressedImage, 'camera/image/compressed', answer, 1)
print('ready', flush=True)
rclpy.spin(node)
"""


def test_a_slow_graph_sees_every_photograph_in_lock_step(tmp_path: Path, bag: Path) -> None:
    answerer = Process(tmp_path / 'answerer.log', ['-c', ANSWERER])
    try:
        answerer.wait_to_say('ready')
        with node(
            tmp_path / 'player.log', 'player_node', bag=bag, rate=0.0, lockstep='hub/cycle'
        ) as player:
            assert player.popen.wait(timeout=100) == 0, player.output
        assert 'going on' not in player.output
        answerer.wait_to_say(f'seen {FRAMES - 1}')
    finally:
        answerer.stop(signal.SIGKILL)


def test_a_player_told_to_end_ends_at_once(tmp_path: Path, bag: Path) -> None:
    with node(
        tmp_path / 'player.log', 'player_node', bag=bag, loop=True, discovery_s=0.1
    ) as player:
        player.wait_to_say('playing 3 topics')
        assert player.stop() == 0
        assert 'Traceback' not in player.output


@pytest.mark.parametrize(
    ('name', 'parameters', 'complaint'),
    [
        ('recorder_node', {}, "parameter 'output' of recorder: name the bag to write"),
        ('recorder_node', {'output': '{bag}'}, 'exists already; name another bag'),
        ('player_node', {'bag': '/nowhere/run'}, '/nowhere/run: no such bag'),
        ('player_node', {'bag': '{bag}', 'start_s': 1e6}, 'lasts 58 s; start before its end'),
        ('player_node', {'bag': '{bag}', 'topics': 'gone'}, "has no topic 'gone'"),
    ],
)
def test_wrong_parameters_end_with_one_line(
    tmp_path: Path, bag: Path, name: str, parameters: dict[str, object], complaint: str
) -> None:
    parameters = {key: str(value).format(bag=bag) for key, value in parameters.items()}
    with node(tmp_path / 'node.log', name, **parameters) as process:
        assert process.popen.wait(timeout=60) == 2, process.output
        assert complaint in process.output
        assert 'Traceback' not in process.output
