"""Starts the graph as processes on this machine, restarts nodes that die, and ends all in order.

For machines without `ros2 launch`; both start the same description.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any, Self

import yaml

from porotwin_core.parent import PARENT
from porotwin_hub.graph import NAMESPACE, NodeDescription

RESTART_PAUSE_S = 1.0
"""Pause before a node that died is started again [s]; doubled with every restart in a row."""

LONGEST_PAUSE_S = 60.0
"""Longest pause before a restart [s]; a node that ran longer begins with the short one again."""

END_PATIENCE_S = 30.0
"""Time for all nodes together to end by themselves [s]: a recorder closes its bag."""

WRONG_PARAMETERS = 2
"""Exit status of a node whose parameters are wrong: a restart would change nothing."""

SayFn = Callable[[str], None]
"""Receives one line for the user."""


class GraphProcesses:
    """The processes of the graph, each with its own log file; a context manager.

    A node that dies is started again, unless it ended with status 0, or with status 2 because its
    parameters are wrong.

    Within the context, SIGHUP (a lost terminal) and SIGTERM have the handler of SIGINT (Ctrl-C).
    If this process is killed, Linux ends the nodes (`porotwin_core.parent`); enter the context from
    a thread that lives as long as they do.
    """

    def __init__(
        self,
        nodes: Sequence[NodeDescription],
        folder: Path,
        *,
        say: SayFn = lambda text: print(text, file=sys.stderr, flush=True),
        show: Sequence[str] = (),
        environment: dict[str, str] | None = None,
        restart_pause_s: float = RESTART_PAUSE_S,
    ) -> None:
        """Prepare to start `nodes`.

        Args:
            nodes: the nodes in the order of their starts; they end in the reverse order.
            folder: the folder for parameter files and logs.
            say: receives a line when a node dies or starts again.
            show: names of nodes whose output goes to `say` as well as to the log.
            environment: variables added to this process's environment.
            restart_pause_s: pause before the first restart of a node [s].
        """
        self._nodes = list(nodes)
        self._folder = folder
        self._say = say
        self._show = set(show)
        self._restart_pause_s = restart_pause_s
        self._environment = {
            **os.environ,
            'PYTHONUNBUFFERED': '1',
            PARENT: str(os.getpid()),
            **(environment or {}),
        }
        self._handlers: dict[int, Any] = {}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._ending = threading.Event()
        self._watchers: list[threading.Thread] = []
        self.failed: dict[str, str] = {}
        """Nodes that are not started again, with the last line of their output."""

    def __enter__(self) -> Self:
        """Start all nodes."""
        (self._folder / 'log').mkdir(parents=True, exist_ok=True)
        for node in self._nodes:
            self._write_parameters(node)
        self._take_signals()
        try:
            for node in self._nodes:
                self._start(node)
                watcher = threading.Thread(target=self._watch, args=(node,), daemon=True)
                watcher.start()
                self._watchers.append(watcher)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End all nodes; kill those that do not end by themselves."""
        for number in self._handlers:  # a terminal that closes may signal more than once
            signal.signal(number, signal.SIG_IGN)
        self._ending.set()
        started = [node.name for node in reversed(self._nodes) if node.name in self._processes]
        for name in started:
            if self.running(name):
                self._processes[name].send_signal(signal.SIGINT)
        deadline = time.monotonic() + END_PATIENCE_S
        for name in started:
            try:
                self._processes[name].wait(max(0.1, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                self._processes[name].kill()
                self._processes[name].wait()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def _take_signals(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return  # Python lets only the main thread set handlers
        interrupt = signal.getsignal(signal.SIGINT)
        if not callable(interrupt):  # a background job of a shell ignores Ctrl-C, not these
            interrupt = signal.default_int_handler
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN:  # nohup wants it ignored
                self._handlers[number] = signal.signal(number, interrupt)

    def log(self, name: str) -> Path:
        """Return the log file of a node."""
        return self._folder / 'log' / f'{name}.log'

    def process(self, name: str) -> subprocess.Popen[bytes]:
        """Return the current process of a node.

        Raises:
            KeyError: it was not started.
        """
        return self._processes[name]

    def running(self, name: str) -> bool:
        """Return whether the process of a node runs."""
        return self._processes[name].poll() is None

    def _parameters(self, node: NodeDescription) -> Path:
        return self._folder / 'log' / f'{node.name}.yaml'

    def _write_parameters(self, node: NodeDescription) -> None:
        self._parameters(node).write_text(
            yaml.safe_dump({'/**': {'ros__parameters': dict(node.parameters)}}), encoding='utf-8'
        )

    def _start(self, node: NodeDescription) -> None:
        command = [sys.executable, '-m', node.module, '--ros-args']
        command += ['-r', f'__ns:={NAMESPACE}', '-r', f'__node:={node.name}']
        command += ['--params-file', str(self._parameters(node))]
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

    def _report(self, text: str) -> None:
        """Pass a line to the user; a terminal that is gone is no error."""
        with contextlib.suppress(OSError):
            self._say(text)

    def _tee(self, name: str, process: subprocess.Popen[bytes]) -> None:
        """Show and log the output of a node; read on even if the log cannot be written."""
        assert process.stdout is not None
        log, reported = self.log(name), False
        for line in process.stdout:
            self._report(line.decode(errors='replace').rstrip())
            try:
                with log.open('ab') as file:
                    file.write(line)
            except OSError as error:
                if not reported:
                    self._report(f'{log} cannot be written ({error.strerror}); going on without')
                reported = True

    def _watch(self, node: NodeDescription) -> None:
        pause = self._restart_pause_s
        while not self._ending.is_set():
            started = time.monotonic()
            status = self._processes[node.name].wait()
            if self._ending.is_set():
                return
            if status == 0:
                self._report(f'{node.name} has ended')
                return
            if status == WRONG_PARAMETERS:
                self.failed[node.name] = self._last_line(node.name)
                self._report(f'{node.name} cannot run: {self.failed[node.name]}')
                return
            if time.monotonic() - started > LONGEST_PAUSE_S:
                pause = self._restart_pause_s
            self._report(f'{node.name} ended ({status}); starting it again in {pause:g} s')
            if self._ending.wait(pause):
                return
            pause = min(2 * pause, LONGEST_PAUSE_S)
            self._start(node)

    def _last_line(self, name: str) -> str:
        lines = self.log(name).read_text(encoding='utf-8', errors='replace').splitlines()
        return next((line for line in reversed(lines) if line.strip()), 'no output')
