"""Two hosts on one machine: network namespaces with a cable between them and without multicast.

As a program it measures what a cut cable does: python tests/two_hosts.py [SECONDS].
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from porotwin_hub.launching.network import Network

ADDRESSES = {'rig': '10.91.7.1', 'server': '10.91.7.2'}
"""The host beside the rig, and the one that computes."""

PORT = 11811

CAMERA = """
import time
import rclpy
from porotwin_core.ros import qos
from sensor_msgs.msg import CompressedImage
rclpy.init()
node = rclpy.create_node('camera', namespace='/porotwin')
publisher = node.create_publisher(CompressedImage, 'camera/image/compressed', qos.PHOTO)
number = 0
while rclpy.ok():
    image = CompressedImage(format=f'{number} {time.monotonic_ns()}', data=bytes(200_000))
    publisher.publish(image)
    number += 1
    time.sleep(0.1)
"""
"""Sends a photograph of 200 kB ten times a second, with its number and time."""

IMAGING = """
import json, time
import rclpy
from porotwin_core.ros import qos
from sensor_msgs.msg import CompressedImage
rclpy.init()
node = rclpy.create_node('imaging', namespace='/porotwin')
def seen(image):
    number, sent = map(int, image.format.split())
    print(json.dumps([number, 1e-9 * (time.monotonic_ns() - sent)]), flush=True)
node.create_subscription(CompressedImage, 'camera/image/compressed', seen, qos.PHOTO)
rclpy.spin(node)
"""
"""Prints the number of every photograph and its latency [s]; both hosts have one clock."""


class Hosts:
    """The hosts `rig` and `server`."""

    def __init__(self, label: str) -> None:
        self.names = {name: f'{label}-{name}' for name in ADDRESSES}
        self._running: list[subprocess.Popen[bytes]] = []

    def make(self) -> str:
        """Make both hosts; return the reason if this machine does not allow it."""
        ends = {name: f'pt{os.getpid() % 100000}{name[0]}' for name in ADDRESSES}
        try:
            for namespace in self.names.values():
                _ip('netns', 'add', namespace)
            _ip('link', 'add', ends['rig'], 'type', 'veth', 'peer', 'name', ends['server'])
            for name, address in ADDRESSES.items():
                _ip('link', 'set', ends[name], 'netns', self.names[name])
                inside = ('-n', self.names[name])
                _ip(*inside, 'link', 'set', ends[name], 'name', 'cable')
                _ip(*inside, 'address', 'add', f'{address}/24', 'dev', 'cable')
                _ip(*inside, 'link', 'set', 'cable', 'multicast', 'off')
                _ip(*inside, 'link', 'set', 'lo', 'up')
                _ip(*inside, 'link', 'set', 'cable', 'up')
        except (OSError, subprocess.CalledProcessError) as error:
            self.remove()
            said = getattr(error, 'stderr', b'') or str(error).encode()
            return f'needs network namespaces ({said.decode(errors="replace").strip()})'
        return ''

    def remove(self) -> None:
        """End all processes and remove both hosts."""
        for process in self._running:
            os.killpg(process.pid, signal.SIGKILL)  # with what the command has started
            process.wait()
        for namespace in self.names.values():
            subprocess.run(['ip', 'netns', 'del', namespace], check=False, capture_output=True)

    def start(
        self, host: str, command: list[str], environment: dict[str, str], output: Path
    ) -> None:
        """Start a command on a host; its output goes into a file."""
        with output.open('wb') as file:
            self._running.append(
                subprocess.Popen(
                    ['ip', 'netns', 'exec', self.names[host], *command],
                    env={**os.environ, **environment},
                    stdout=file,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            )

    def cut(self) -> None:
        """Pull the cable out."""
        _ip('-n', self.names['rig'], 'link', 'set', 'cable', 'down')

    def mend(self) -> None:
        """Put the cable in."""
        _ip('-n', self.names['rig'], 'link', 'set', 'cable', 'up')


def _ip(*words: str) -> None:
    subprocess.run(['ip', *words], check=True, capture_output=True)


class Photographs:
    """What the host `server` has received so far."""

    def __init__(self, log: Path) -> None:
        self._log = log

    @property
    def received(self) -> list[tuple[int, float]]:
        """Number and latency [s] of every photograph."""
        lines = self._log.read_text(errors='replace').splitlines()
        return [
            tuple(json.loads(line)) for line in lines if line.startswith('[') and line[-1] == ']'
        ]

    def wait_for(self, number: int, timeout: float) -> float:
        """Return the time until a photograph from `number` on has arrived [s]."""
        begin = time.monotonic()
        while not any(seen >= number for seen, _ in self.received):
            waited = time.monotonic() - begin
            assert waited < timeout, (
                f'no photograph {number} in {timeout:g} s: {self._log.read_text()}'
            )
            time.sleep(0.1)
        return time.monotonic() - begin


@contextmanager
def camera_and_imaging(hosts: Hosts, network: Network, folder: Path) -> Iterator[Photographs]:
    """Run a camera on the host `rig` and imaging on the host `server`."""
    environment = network.environment()
    if network.discovery_server:
        tool = Path(sys.executable).with_name('fastdds')
        words = [str(tool), 'discovery', '-i', '0', '-l', ADDRESSES['rig'], '-p', str(PORT)]
        hosts.start('rig', words, {}, folder / 'discovery.log')
    hosts.start('server', [sys.executable, '-c', IMAGING], environment, folder / 'imaging.log')
    hosts.start('rig', [sys.executable, '-c', CAMERA], environment, folder / 'camera.log')
    yield Photographs(folder / 'imaging.log')


PROFILES = {
    'peers': Network(peers=tuple(ADDRESSES.values())),
    'discovery server': Network(discovery_server=f'{ADDRESSES["rig"]}:{PORT}'),
}


def figures(hosts: Hosts, network: Network, folder: Path, cut_s: float) -> dict[str, float]:
    """Return latency and losses before, during and after a cut of the cable."""
    with camera_and_imaging(hosts, network, folder) as photographs:
        photographs.wait_for(0, 60.0)
        first = photographs.received[0][0]
        photographs.wait_for(first + 30, 60.0)
        before = photographs.received
        hosts.cut()
        time.sleep(cut_s)
        last = max(number for number, _ in photographs.received)
        hosts.mend()
        back_s = photographs.wait_for(last + 1, 90.0)
        photographs.wait_for(last + 20 + round(10 * cut_s), 90.0)
        numbers = {number for number, _ in photographs.received}
        lost = len(set(range(first, max(numbers) + 1)) - numbers)
        latencies = sorted(latency for _, latency in before)
        return {
            'latency_median_s': latencies[len(latencies) // 2],
            'latency_largest_s': latencies[-1],
            'lost_before_the_cut': len(set(range(first, before[-1][0] + 1)) - numbers),
            'cut_s': cut_s,
            'lost_in_the_cut': lost,
            'back_after_s': back_s,
        }


def main() -> None:
    """Print the figures of every profile for a cut of so many seconds."""
    import tempfile

    cut_s = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    for name, network in PROFILES.items():
        hosts = Hosts(f'porotwin{os.getpid()}')
        if reason := hosts.make():
            sys.exit(reason)
        try:
            with tempfile.TemporaryDirectory() as folder:
                print(name, json.dumps(figures(hosts, network, Path(folder), cut_s)), flush=True)
        finally:
            hosts.remove()


if __name__ == '__main__':
    main()
