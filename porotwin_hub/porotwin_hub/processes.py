"""Starts the graph as processes on this machine, watches them, and ends them in order.

For machines without `ros2 launch`; it starts the same description.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Self

import yaml

from porotwin_hub.graph import NAMESPACE, NodeDescription

RESTART_PAUSE_S = 1.0
"""Wait before a node that died is started again; doubled each time, to a minute."""

END_PATIENCE_S = 30.0
"""Time for all nodes together to end by themselves: a recorder closes its bag."""

SayFn = Callable[[str], None]


class GraphProcesses:
    """The graph's processes, each with a log file of its own; a context manager.

    A node that dies is started again, unless it ended by itself with status 0 or said (status 2)
    that its parameters are wrong: that would only happen again.
    """

    def __init__(
        self,
        nodes: Sequence[NodeDescription],
        folder: Path,
        *,
        say: SayFn = lambda text: print(text, file=sys.stderr, flush=True),
        show: Sequence[str] = (),
        environment: dict[str, str] | None = None,
    ) -> None:
        """Prepare to start `nodes`.

        Args:
            nodes: what to start, in this order; they end in the reverse order.
            folder: where parameter files and logs go.
            say: told in one line when a node dies or starts again.
            show: names of nodes whose output goes to the terminal as well as to the log.
            environment: added to this process's environment.
        """
        self._nodes = list(nodes)
        self._folder = folder
        self._say = say
        self._show = set(show)
        self._environment = {**os.environ, 'PYTHONUNBUFFERED': '1', **(environment or {})}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._ending = threading.Event()
        self._watchers: list[threading.Thread] = []
        self.failed: dict[str, str] = {}
        """Nodes that will not be started again, and the last line each said."""

    def __enter__(self) -> Self:
        (self._folder / 'log').mkdir(parents=True, exist_ok=True)
        for node in self._nodes:
            self._start(node)
            watcher = threading.Thread(target=self._watch, args=(node,), daemon=True)
            watcher.start()
            self._watchers.append(watcher)
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        for node in reversed(self._nodes):
            process = self._processes[node.name]
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + END_PATIENCE_S
        for process in self._processes.values():
            try:
                process.wait(max(0.1, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def log(self, name: str) -> Path:
        """Return the log file of a node."""
        return self._folder / 'log' / f'{name}.log'

    def process(self, name: str) -> subprocess.Popen[bytes]:
        """Return the newest process of a node."""
        return self._processes[name]

    def running(self, name: str) -> bool:
        """Return whether a node's process is there."""
        return self._processes[name].poll() is None

    def _start(self, node: NodeDescription) -> None:
        parameters = self._folder / 'log' / f'{node.name}.yaml'
        parameters.write_text(
            yaml.safe_dump({'/**': {'ros__parameters': dict(node.parameters)}}), encoding='utf-8'
        )
        command = [sys.executable, '-m', node.module, '--ros-args']
        command += ['-r', f'__ns:={NAMESPACE}', '-r', f'__node:={node.name}']
        command += ['--params-file', str(parameters)]
        for source, target in node.remappings.items():
            command += ['-r', f'{source}:={target}']
        output: int | IO[bytes]
        with self.log(node.name).open('ab') as log:
            output = subprocess.PIPE if node.name in self._show else log
            process = subprocess.Popen(
                command,
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,
            )
        self._processes[node.name] = process
        if node.name in self._show:
            threading.Thread(target=self._tee, args=(node.name, process), daemon=True).start()

    def _tee(self, name: str, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with self.log(name).open('ab') as log:
            for line in process.stdout:
                log.write(line)
                log.flush()
                self._say(line.decode(errors='replace').rstrip())

    def _watch(self, node: NodeDescription) -> None:
        pause = RESTART_PAUSE_S
        while not self._ending.is_set():
            started = time.monotonic()
            status = self._processes[node.name].wait()
            if self._ending.is_set():
                return
            if status == 0:
                self._say(f'{node.name} has ended')
                return
            if status == 2:
                self.failed[node.name] = self._last_line(node.name)
                self._say(f'{node.name} cannot run: {self.failed[node.name]}')
                return
            if time.monotonic() - started > 60.0:
                pause = RESTART_PAUSE_S
            self._say(f'{node.name} ended ({status}); starting it again in {pause:g} s')
            if self._ending.wait(pause):
                return
            pause = min(2 * pause, 60.0)
            self._start(node)

    def _last_line(self, name: str) -> str:
        lines = self.log(name).read_text(encoding='utf-8', errors='replace').splitlines()
        return next((line for line in reversed(lines) if line.strip()), 'no output')
