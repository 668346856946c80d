"""Tests of the player node in a running graph, and of its exit status."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from node_processes import FRAMES, Process, by_topic, node, record_replay, write_minute_bag
from patience import PATIENCE_S
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from refused_node import refusal

from porotwin_recording import player_node
from porotwin_recording.experiment.bag_conversion import IMPORT_START
from porotwin_recording.live.replay_topics import ACKNOWLEDGE_TIMEOUT
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage
from porotwin_recording.mcap.bag_writer import BagWriter
from porotwin_recording.mcap.serialization import SECOND, stamp_of

pytestmark = pytest.mark.graph

SAMPLE = Path(__file__).resolve().parents[2] / 'bags' / 'sample'

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
rclpy.spin(node)
"""

HUB = """
import rclpy
rclpy.init()
node = rclpy.create_node('hub', namespace='/porotwin')
node.declare_parameter('rig', 'rigs/mine/rig.yaml')
print('ready', flush=True)
rclpy.spin(node)
"""


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_minute_bag(tmp_path_factory.mktemp('minute'))


@pytest.fixture(scope='module')
def inputs(tmp_path_factory: pytest.TempPathFactory, bag: Path) -> BagReader:
    """A replay with the defaults, recorded."""
    return record_replay(tmp_path_factory.mktemp('inputs'), bag, rate=0.0)


def test_a_recorded_replay_is_the_recording(tmp_path: Path, bag: Path) -> None:
    recorded = record_replay(tmp_path, bag, rate=0.0, topics='all')
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
    recorded = record_replay(tmp_path, bag, rate=20.0, start_s=30.0, topics='all')
    assert recorded.topics['/porotwin/rig/description'].message_count == 1
    assert recorded.topics['/porotwin/asset/new_state'].message_count == FRAMES - 15
    clock = [
        int(time.clock.sec) * SECOND + int(time.clock.nanosec)
        for time in (recorded.decode(message) for message in recorded.messages(['/clock']))
    ]
    assert clock == sorted(clock)
    assert clock[0] >= IMPORT_START + 30 * SECOND
    assert clock[-1] == IMPORT_START + 2 * (FRAMES - 1) * SECOND
    # the log times are simulated: the recorder follows the clock of the replay
    assert recorded.start_time >= IMPORT_START + 30 * SECOND
    assert recorded.end_time <= IMPORT_START + 2 * FRAMES * SECOND


def test_only_the_inputs_of_the_twin_are_played_by_default(inputs: BagReader) -> None:
    played = {name for name, topic in inputs.topics.items() if topic.message_count}
    assert {name for name in played if name.startswith('/porotwin')} == {
        '/porotwin/camera/image/compressed',
        '/porotwin/camera/baseline/compressed',
        '/porotwin/wells/measured',
    }


def test_setpoints_without_measured_rates_are_told_again_at_each_photograph(
    inputs: BagReader,
) -> None:
    photographs, rates = (
        {stamp_of(message.data) for message in inputs.messages([f'/porotwin/{name}'])}
        for name in ('camera/image/compressed', 'wells/measured')
    )
    assert len(photographs) == FRAMES - 1
    assert photographs <= rates


def test_a_slow_graph_receives_every_photograph_in_lock_step(tmp_path: Path, bag: Path) -> None:
    answerer = Process(tmp_path / 'answerer.log', ['-c', ANSWERER])
    try:
        with node(
            tmp_path / 'player.log', 'player_node', bag=bag, rate=0.0, lockstep='hub/cycle'
        ) as player:
            assert player.popen.wait(timeout=PATIENCE_S) == 0, player.output
        assert 'going on' not in player.output
        answerer.wait_for_output(f'seen {FRAMES - 1}')
    finally:
        answerer.stop(signal.SIGKILL)


def test_lock_step_without_the_answering_node_plays_nothing(tmp_path: Path, bag: Path) -> None:
    with node(
        tmp_path / 'player.log', 'player_node', bag=bag, lockstep='hub/cycle', discovery_s=0.5
    ) as player:
        assert player.popen.wait(timeout=PATIENCE_S) == 1, player.output
    (line,) = [line for line in player.output.splitlines() if 'ERROR' in line]
    assert 'waited 0.5 s for the node that answers in lock-step' in line
    assert 'nothing was played; start ./porotwin up --replay' in line


def test_a_graph_in_real_time_is_named_and_refused(tmp_path: Path, bag: Path) -> None:
    hub = Process(tmp_path / 'hub.log', ['-c', HUB])
    try:
        hub.wait_for_output('ready')
        with node(tmp_path / 'player.log', 'player_node', bag=bag) as player:
            assert player.popen.wait(timeout=PATIENCE_S) == 1, player.output
    finally:
        hub.stop(signal.SIGKILL)
    (line,) = [line for line in player.output.splitlines() if 'ERROR' in line]
    assert 'the graph /porotwin of the rig rigs/mine/rig.yaml runs in real time' in line
    assert 'nothing was played: stop it and start ./porotwin up --replay' in line


def test_an_interrupt_ends_the_player(tmp_path: Path, bag: Path) -> None:
    with node(
        tmp_path / 'player.log', 'player_node', bag=bag, loop=True, discovery_s=0.0
    ) as player:
        player.wait_for_output('playing 3 topics')
        assert player.stop() == 0
        assert 'Traceback' not in player.output


def test_an_interrupt_ends_a_player_of_all_topics(tmp_path: Path) -> None:
    with node(
        tmp_path / 'player.log', 'player_node', bag=SAMPLE, topics='/diagnostics', discovery_s=0.0
    ) as player:
        player.wait_for_output('playing 1 topics')
        assert player.stop() == 0


@pytest.mark.parametrize(
    ('parameters', 'complaint'),
    [
        ({'bag': '/nowhere/run'}, '/nowhere/run: no such bag'),
        ({'bag': '{bag}', 'start_s': 1e6}, 'lasts 58 s; start before its end'),
        ({'bag': '{bag}', 'topics': 'gone'}, "has no topic 'gone'"),
    ],
)
def test_wrong_parameters_end_with_one_line(
    bag: Path,
    parameters: dict[str, object],
    complaint: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    parameters = {key: str(value).format(bag=bag) for key, value in parameters.items()}
    output = refusal(player_node.main, monkeypatch, capfd, **parameters)
    assert complaint in output
    assert 'Traceback' not in output


def played(monkeypatch: pytest.MonkeyPatch, *parameters: str) -> None:
    """Give the player of this process its parameters."""
    values = ['discovery_s:=0.0', *parameters]
    arguments = [word for value in values for word in ('-p', value)]
    monkeypatch.setattr(sys, 'argv', ['player', '--ros-args', *arguments])


class BrokenBag(BagReader):
    """A bag with a fault that nobody foresaw."""

    def messages(self, *_: object, **__: object) -> Iterator[BagMessage]:
        raise RuntimeError('no such luck')


def test_an_unexpected_failure_gives_exit_status_1(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    played(monkeypatch, f'bag:={SAMPLE}')
    with pytest.raises(SystemExit) as ended:
        player_node.main(BrokenBag)
    assert ended.value.code == 1
    assert 'no such luck' in capfd.readouterr().err


def test_a_bag_without_playable_topics_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with BagWriter(tmp_path / 'run') as writer:
        writer.add_topic('/words', 'std_msgs/msg/String', definition='string text\n')
        writer.write('/words', b'\x00\x01\x00\x00', log_time=1)
    played(monkeypatch, f'bag:={tmp_path / "run"}', 'topics:=all')
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code not in (0, None)
    output = capfd.readouterr().err
    assert 'recorded in another version' in output
    assert 'none of the chosen topics can be played' in output


def test_an_interrupt_ends_the_wait_for_a_subscriber_that_is_silent(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked: list[float] = []

    def silent(_: object, duration: Duration) -> bool:
        asked.append(duration.nanoseconds / SECOND)
        if len(asked) == 1:
            os.kill(os.getpid(), signal.SIGINT)
        return False

    monkeypatch.setattr(Publisher, 'wait_for_all_acked', silent)
    played(monkeypatch, f'bag:={SAMPLE}', 'rate:=0.0')
    with pytest.raises(SystemExit) as ended:
        player_node.main()
    assert ended.value.code == 0
    assert sum(asked) < ACKNOWLEDGE_TIMEOUT
    assert 'acknowledged' not in capfd.readouterr().err


def test_an_interrupt_while_the_bag_is_opened_is_no_failure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(_: str) -> BagReader:
        raise KeyboardInterrupt

    played(monkeypatch, f'bag:={SAMPLE}')
    with pytest.raises(SystemExit) as ended:
        player_node.main(interrupted)
    assert ended.value.code == 0
