"""Starts the graph as processes on this machine, restarts nodes that die, and ends all in order.

For machines without `ros2 launch`; both start the same description.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Self

import yaml

from porotwin_core.basis.parent import PARENT, REFUSAL, WRONG_PARAMETERS
from porotwin_core.basis.plain_text import plain
from porotwin_core.clock.freshness import RESTART_AFTER_S
from porotwin_core.clock.periods import END_S
from porotwin_core.clock.stamps import MACHINE_START_S, STEADY_CLOCK
from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.node_processes import POLL_S, kill, process_of

RESTART_PAUSE_S = 1.0
"""Pause before a node that died is started again [s]; doubled with every restart in a row."""

LONGEST_PAUSE_S = 10.0
"""Longest pause before a restart [s]: a start costs seconds of computing."""

STEADY_S = 60.0
"""A node that ran longer than this begins with the short pause again [s]."""

END_PATIENCE_S = 30.0
"""Time for all nodes together to end by themselves [s]: a recorder closes its bag."""


TEE_PATIENCE_S = 2.0
"""Longest wait for the last output of a node that has ended [s]; a child may hold it open."""

LOG_LIMIT_BYTES = 10_000_000
"""A log file that is larger becomes NAME.log.1, in place of the one before."""

SayFn = Callable[[str], None]
"""Receives one line for the user."""


def _ignore(*_: object) -> None:
    """Ignore a signal; unlike `SIG_IGN`, a process that is started does not inherit this."""


@dataclass
class _Kept:
    """A node that is kept running: its process, and the time of its next start."""

    node: NodeDescription
    process: subprocess.Popen[bytes]
    pause_s: float
    started: float = field(default_factory=time.monotonic)
    restart_at: float | None = None
    stopped_since: float | None = None
    given_up: bool = False
    first_start: bool = True


class GraphProcesses:
    """The processes of the graph, each with its own log file; a context manager.

    A node that ends is started again, unless its work is done, or it ended at its first start with
    status 2, because its parameters are wrong. A node whose process is stopped
    for 30 s is killed and started again. Nodes that hang in another way are ended by the node
    `supervisor`. A log file has at most 10 MB and one predecessor of that size.

    Within the context, SIGHUP (a lost terminal) and SIGTERM have the handler of SIGINT (Ctrl-C).
    If this process is killed, Linux ends the nodes (`porotwin_core.basis.parent`); enter the
    context from a thread that lives as long as they do.
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
        stopped_patience_s: float = RESTART_AFTER_S,
        end_patience_s: float = END_PATIENCE_S,
        log_limit_bytes: int = LOG_LIMIT_BYTES,
    ) -> None:
        """Prepare to start `nodes`.

        Args:
            nodes: the nodes in the order of their starts; they end in the reverse order.
            folder: the folder for parameter files and logs.
            say: receives a line when a node dies or starts again.
            show: names of nodes whose output goes to `say` as well as to the log.
            environment: variables added to this process's environment.
            restart_pause_s: pause before the first restart of a node [s].
            stopped_patience_s: longest time that a process may be stopped [s].
            end_patience_s: time for all nodes together to end by themselves [s].
            log_limit_bytes: largest size of a log file.
        """
        self._nodes = list(nodes)
        self._folder = folder
        self._say = say
        self._show = set(show)
        self._restart_pause_s = restart_pause_s
        self._stopped_patience_s = stopped_patience_s
        self._end_patience_s = end_patience_s
        self._log_limit_bytes = log_limit_bytes
        self._environment = {
            **os.environ,
            'PYTHONUNBUFFERED': '1',
            'PYTHONIOENCODING': 'utf-8:backslashreplace',  # for `_tee`, and for readers of logs
            PARENT: str(os.getpid()),
            STEADY_CLOCK: str(MACHINE_START_S),
            **(environment or {}),
        }
        self._handlers: dict[int, Any] = {}
        self._kept: dict[str, _Kept] = {}
        self._tees: dict[str, threading.Thread] = {}
        self._told: set[str] = set()
        self._ending = threading.Event()
        self._starting = threading.Lock()
        self.failed: dict[str, str] = {}
        """Nodes that refused their parameters, with the reason; see `refusal`."""

    def __enter__(self) -> Self:
        """Start all nodes."""
        (self._folder / 'log').mkdir(parents=True, exist_ok=True)
        for node in self._nodes:
            self._write_parameters(node)
        self._take_signals()
        try:
            for node in self._nodes:
                self._kept[node.name] = _Kept(node, self._started(node), self._restart_pause_s)
            threading.Thread(target=self._keep, daemon=True).start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End all nodes; kill those that do not end by themselves."""
        for number in self._handlers:  # a terminal that closes may signal more than once
            signal.signal(number, signal.SIG_IGN)
        with self._starting:  # from here on nothing is started again
            self._ending.set()
        running = [name for name in reversed(self._kept) if self.running(name)]
        for name in running:
            # one that is still loading ends without a word, while SIGINT gives a traceback
            self._kept[name].process.send_signal(signal.SIGTERM)
            self._kept[name].process.send_signal(signal.SIGCONT)  # it may be stopped
        deadline = time.monotonic() + self._end_patience_s
        for name in running:
            self._await_end(name, max(0.1, deadline - time.monotonic()))
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def _await_end(self, name: str, patience_s: float) -> None:
        process = self._kept[name].process
        try:
            process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._report(f'{name} did not end within {self._end_patience_s:g} s and is killed')
            kill(process.pid)
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                self._report(f'{name} cannot be killed: process {process.pid} waits for a device')

    def _take_signals(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return  # Python lets only the main thread set handlers
        interrupt = signal.getsignal(signal.SIGINT)
        if interrupt is signal.SIG_IGN:  # a node would inherit it, and could not end in order
            self._handlers[signal.SIGINT] = signal.signal(signal.SIGINT, _ignore)
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
        return self._kept[name].process

    def running(self, name: str) -> bool:
        """Return whether the process of a node runs."""
        return self._kept[name].process.poll() is None

    def refusal(self, optional: Collection[str] = ()) -> str | None:
        """Return the line of a node that refused its parameters; None if none did.

        The lines of `optional` nodes, without which the graph goes on, go to the user once.
        """
        for name, why in list(self.failed.items()):
            if name not in optional:
                return f'{name} cannot run: {why}'
            if name not in self._told:
                self._told.add(name)
                self._report(f'{name} cannot run, going on without: {why}')
        return None

    def _parameters(self, node: NodeDescription) -> Path:
        return self._folder / 'log' / f'{node.name}.yaml'

    def _write_parameters(self, node: NodeDescription) -> None:
        self._parameters(node).write_text(
            yaml.safe_dump({'/**': {'ros__parameters': dict(node.parameters)}}), encoding='utf-8'
        )

    def _started(self, node: NodeDescription) -> subprocess.Popen[bytes]:
        # logs go to the standard output, so ROS's second copy in the home folder is not needed
        # without the user's folder on the path: a file there may have the name of a module
        command = [sys.executable, '-P', '-m', node.module]
        command += ['--ros-args', '--disable-external-lib-logs']
        command += ['-r', f'__ns:={node.namespace}', '-r', f'__node:={node.name}']
        command += ['--params-file', str(self._parameters(node))]
        command += [
            '--enclave',
            f'{node.namespace}/{node.name}',
        ]  # its rights, see docs/security.md
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
        if node.name in self._show:
            tee = threading.Thread(target=self._tee, args=(node.name, process), daemon=True)
            tee.start()
            self._tees[node.name] = tee
        return process

    def _report(self, text: str) -> None:
        """Pass a line to the user, who may see it on a terminal; one that is gone is no error."""
        with contextlib.suppress(OSError):
            self._say(plain(text))

    def _tee(self, name: str, process: subprocess.Popen[bytes]) -> None:
        """Show and log the output of a node; read on even if the log cannot be written."""
        assert process.stdout is not None
        log, reported = self.log(name), False
        for line in process.stdout:
            text = line.decode(errors='replace').rstrip()
            if not text.startswith(REFUSAL):  # told once, from `failed`
                self._report(text)
            try:
                with log.open('ab') as file:
                    file.write(line)
            except OSError as error:
                if not reported:
                    self._report(f'{log} cannot be written ({error.strerror}); going on without')
                reported = True

    def _keep(self) -> None:
        """Look after all processes until the end; no failure of one look ends it."""
        refusal, looked = '', 0.0
        while not self._ending.wait(POLL_S):
            if time.monotonic() - looked > self._restart_pause_s:
                refusal, looked = self._tell_disk(before=refusal), time.monotonic()
            for kept in self._kept.values():
                try:
                    self._look(kept)
                    self._limit_log(self.log(kept.node.name))
                except Exception as error:  # no memory or processes left: tried again
                    self._report(f'{kept.node.name}: {error!r}')

    def _tell_disk(self, *, before: str) -> str:
        """Return why the disk of the logs takes no new file now, '' if it does; tell a change."""
        folder, refusal = self._folder / 'log', ''
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(b'1')
        except FileNotFoundError:  # the folder is gone
            return before
        except OSError as error:  # full, also of files or of a quota, or read-only
            refusal = error.strerror or str(error)
        if refusal != before:
            now = f'takes no data ({refusal}); lines of logs are lost'
            self._report(f'{folder}: {now if refusal else "takes data again; lines are missing"}')
        return refusal

    def _look(self, kept: _Kept) -> None:
        status = kept.process.poll()
        if kept.given_up:
            return
        if kept.restart_at is not None:
            if time.monotonic() >= kept.restart_at:
                self._start_again(kept)
        elif status is None:
            self._end_if_stopped(kept)
        else:
            self._on_end(kept, status)

    def _start_again(self, kept: _Kept) -> None:
        with self._starting:
            if not self._ending.is_set():
                kept.process = self._started(kept.node)
                kept.started, kept.first_start = time.monotonic(), False
                kept.restart_at = kept.stopped_since = None

    def _end_if_stopped(self, kept: _Kept) -> None:
        process, now = process_of(kept.process.pid), time.monotonic()
        if process is None or not process.stopped:
            kept.stopped_since = None
        elif kept.stopped_since is None:
            kept.stopped_since = now
        elif now - kept.stopped_since > self._stopped_patience_s:
            self._report(f'{kept.node.name} was stopped for {self._stopped_patience_s:g} s; killed')
            kill(kept.process.pid)

    def _on_end(self, kept: _Kept, status: int) -> None:
        """Give up a node that has ended, or set the time of its next start."""
        name = kept.node.name
        if status == 0 and kept.node.finishes:
            kept.given_up = True
            self._report(f'{name} has ended')
        elif status == WRONG_PARAMETERS and kept.first_start:
            kept.given_up = True
            self.failed[name] = self._last_line(name)
        else:
            if time.monotonic() - kept.started > STEADY_S:
                kept.pause_s = self._restart_pause_s
            why: object = self._last_line(name) if status == WRONG_PARAMETERS else status
            why = 'somebody ended it' if status in (0, -signal.SIGTERM) else why
            self._report(f'{name} ended ({why}); starting it again in {kept.pause_s:g} s')
            kept.restart_at = time.monotonic() + kept.pause_s
            kept.pause_s = min(2 * kept.pause_s, LONGEST_PAUSE_S)

    def _limit_log(self, log: Path) -> None:
        """Move a log that has grown too large aside; the node goes on writing into the same file.

        Lines that are written between the copy and the cut are lost.
        """
        if not log.is_file() or log.stat().st_size <= self._log_limit_bytes:
            return
        older = log.with_name(f'{log.name}.1')
        try:
            shutil.copyfile(log, older)
        except OSError:  # a full disk: the newest lines matter more
            older.unlink(missing_ok=True)
        os.truncate(log, 0)

    def _last_line(self, name: str) -> str:
        if name in self._tees:
            self._tees[name].join(TEE_PATIENCE_S)
        lines = self.log(name).read_text(encoding='utf-8', errors='replace').splitlines()
        last = next((line for line in reversed(lines) if line.strip()), 'no output')
        return last.removeprefix(REFUSAL)
