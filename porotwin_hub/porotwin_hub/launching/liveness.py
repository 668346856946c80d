"""Decides which nodes are silent, and which of those hang and must be started again.

Every node tells its health once a second. A node that computes in a thread of its own goes on
telling it, so silence means a stopped process or a stuck executor.
"""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from porotwin_core.clock.freshness import RESTART_AFTER_S, STALE_AFTER_S
from porotwin_hub.launching.node_processes import NodeProcess

START_PATIENCE_S = 300.0
"""Longest time from the start of a process to its first report [s]: compiling kernels takes 60."""

COMPUTING_FACTOR = 10.0
"""A process that computes all the time may be silent this much longer before it is ended.

Compiled code may keep Python's interpreter lock, and the node is then silent, but does not hang.
"""

COMPUTING_SHARE = 0.2
"""A process that uses more than this share of one processor computes."""


@dataclass(frozen=True)
class Silence:
    """A node that tells nothing.

    Attributes:
        name: name of the node.
        message: one line.
        hangs: whether it must be ended.
    """

    name: str
    message: str
    hangs: bool


class Liveness:
    """Keeps the time of each node's last report."""

    def __init__(
        self,
        names: Iterable[str],
        *,
        own: str,
        stale_after_s: float = STALE_AFTER_S,
        restart_after_s: float = RESTART_AFTER_S,
        start_patience_s: float = START_PATIENCE_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Expect reports of the nodes called `names`.

        Args:
            names: names of nodes.
            own: name of the node that listens; its own reports come as those of the others do.
            stale_after_s: a node that is silent for longer is stale [s].
            restart_after_s: a node that is silent for longer hangs [s]; 0: no node is ended.
            start_patience_s: longest time from start to first report [s].
            clock: returns a steady time [s].
        """
        self._clock = clock
        self._heard = dict.fromkeys(names, clock())
        self._first_looks: dict[str, tuple[float, float, float]] = {}
        self._stale_after_s = stale_after_s
        self._restart_after_s = restart_after_s
        self._start_patience_s = start_patience_s
        self._own = own
        self._heard_own = self._looked = clock()

    def heard(self, name: str) -> None:
        """Note a report of a node; other nodes than the expected ones are ignored."""
        if name == self._own:
            self._heard_own = self._clock()
        if name in self._heard:
            self._heard[name] = self._clock()

    @property
    def deaf(self) -> bool:
        """Whether the node that listens does not even hear itself, as in a flood of reports."""
        return self._clock() - self._heard_own > self._stale_after_s

    def silent(self, processes: Callable[[], dict[str, NodeProcess]]) -> list[Silence]:
        """Return the nodes that are silent now; to be called once a second.

        If the calls themselves paused, then this process was stopped. If its own reports are not
        heard, those of others are lost too. Nothing is known about the nodes in that time, and all
        of them count as just heard.

        Args:
            processes: returns the processes of the nodes by name; called only if one is silent.
        """
        now = self._clock()
        if self.deaf or now - self._looked > self._stale_after_s:
            self._heard = dict.fromkeys(self._heard, now)
        self._looked = now
        stale = [name for name, heard in self._heard.items() if now - heard > self._stale_after_s]
        if not stale:
            return []
        found = processes()
        return [self._judged(name, found.get(name)) for name in stale]

    def _judged(self, name: str, process: NodeProcess | None) -> Silence:
        silence = self._clock() - self._heard[name]
        if process is None:
            message = f'silent for {silence:.0f} s: no process of it is known here'
            return Silence(name, message, hangs=False)
        starting = silence >= process.age_s
        silence = min(silence, process.age_s)
        if process.stopped:
            state, patience = 'its process is stopped', self._restart_after_s
        elif starting:
            state, patience = 'it is starting', self._start_patience_s
        elif self._computes(name, process):
            state, patience = 'it computes', COMPUTING_FACTOR * self._restart_after_s
        else:
            state, patience = 'it hangs', self._restart_after_s
        hangs = self._restart_after_s > 0.0 and silence > patience
        return Silence(name, f'silent for {silence:.0f} s: {state}', hangs)

    def _computes(self, name: str, process: NodeProcess) -> bool:
        """Return whether a process has computed since the first look at it in this silence."""
        now = self._clock()
        heard, looked, before_s = self._first_looks.get(name, (math.nan, now, process.cpu_s))
        if heard != self._heard[name]:
            looked, before_s = now, process.cpu_s
            self._first_looks[name] = self._heard[name], looked, before_s
        return process.cpu_s - before_s > COMPUTING_SHARE * (now - looked)
