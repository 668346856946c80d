"""Recorder and player as processes, and a bag for them; shared by the tests of both nodes."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from patience import PATIENCE_S, until
from recording_examples import bench_rig

from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_recording.experiment.bag_conversion import import_experiment
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.mcap.bag_records import BagMessage
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.photos import Photo
from porotwin_recording.tables.recorded_data import RecordedData

FRAMES = 30


class Process:
    """A node in a process of its own, with its output in a file."""

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
        """Everything that the process has printed so far."""
        return self.log.read_text()

    def wait_for_output(self, text: str) -> None:
        """Wait until the process prints `text`.

        Raises:
            AssertionError: it ended without, or took too long.
        """
        until(lambda: text in self.output or self.popen.poll() is not None)
        assert text in self.output, self.output

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal unless the process has ended, and return its exit status."""
        if self.popen.poll() is None:
            self.popen.send_signal(number)
        return self.popen.wait(timeout=PATIENCE_S)


@contextmanager
def node(log: Path, name: str, **parameters: object) -> Iterator[Process]:
    """Run a node of porotwin_recording; kill it at the end of the block."""
    arguments = ['-m', f'porotwin_recording.{name}', '--ros-args', '-r', '__ns:=/porotwin']
    for key, value in parameters.items():
        arguments += ['-p', f'{key}:={value}']
    process = Process(log, arguments)
    try:
        yield process
    finally:
        process.stop(signal.SIGKILL)


def write_minute_bag(folder: Path) -> Path:
    """Write a bag with a minute of states, photographs and rates, a state every 2 s."""
    rig = bench_rig()
    grid = rig.grid(187, 112)
    generator = np.random.default_rng(731)
    frames = generator.random((FRAMES, *grid.shape), dtype=np.float32)
    images = [b'\xff\xd8' + generator.bytes(200_000) for _ in range(FRAMES)]
    data = RecordedData(
        rig,
        commanded=Schedule.constant({'in': WellRate(1e-7, 1.0)}),
        maps=ConcentrationMaps(np.arange(FRAMES) * 2.0, grid, lambda a, b: frames[a:b]),
        photos=tuple(
            Photo(
                2.0 * number,
                'state' if number else 'baseline',
                f'photos/{number}.jpg',
                lambda image=image: image,
            )
            for number, image in enumerate(images)
        ),
    )
    write_folder(folder / 'experiment', data)
    import_experiment(folder / 'experiment', folder / 'bag')
    return folder / 'bag'


def by_topic(messages: Iterator[BagMessage]) -> dict[str, list[bytes]]:
    """Return the data of messages by topic."""
    found: dict[str, list[bytes]] = {}
    for message in messages:
        found.setdefault(message.topic, []).append(message.data)
    return found


def record_replay(tmp_path: Path, bag: Path, **parameters: object) -> BagReader:
    """Play `bag` to a recorder and return the recorded bag."""
    output = tmp_path / 'recorded'
    with (
        node(tmp_path / 'recorder.log', 'recorder_node', output=output, use_sim_time=True) as rec,
        node(tmp_path / 'player.log', 'player_node', bag=bag, discovery_s=20.0, **parameters) as p,
    ):
        assert p.popen.wait(timeout=PATIENCE_S) == 0, p.output
        until(lambda: 'played' in p.output)
        assert rec.stop() == 0, rec.output
        assert ' 0 lost' in rec.output
    return BagReader(output)
