"""The processes of the graph's nodes: found by name, and ended."""

import contextlib
import os
import signal
import time
from collections.abc import Iterable
from dataclasses import dataclass

import psutil

from porotwin_core.basis.parent import PARENT
from porotwin_core.clock.periods import POLL_S


@dataclass(frozen=True)
class NodeProcess:
    """A process at one moment.

    Attributes:
        pid: its number.
        stopped: whether it is stopped, as by SIGSTOP. A process under a debugger is not.
        age_s: time since its start [s].
        cpu_s: processor time that it has used [s].
    """

    pid: int
    stopped: bool
    age_s: float
    cpu_s: float


def process_of(pid: int) -> NodeProcess | None:
    """Return the process with a number; None if it is gone, a zombie, or not shown."""
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            state, used = process.status(), process.cpu_times()
            began = process.create_time() - psutil.boot_time()  # steps of the clock are in both
    except psutil.Error:
        return None
    if state in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD):
        return None
    return NodeProcess(
        pid,
        stopped=state == psutil.STATUS_STOPPED,
        age_s=time.clock_gettime(time.CLOCK_BOOTTIME) - began,
        cpu_s=used.user + used.system,
    )


def nodes_of(launcher: str) -> dict[str, NodeProcess]:
    """Return the processes of all nodes that a launcher started, by the name of the node.

    A launcher gives its process number to its nodes in the environment variable `PARENT`, and
    the name by the argument `__node:=NAME`. Nothing is taken from a message.
    """
    found = {}
    for shown in psutil.process_iter(['environ']):
        if (shown.info['environ'] or {}).get(PARENT) != launcher:
            continue  # somebody else's process shows no environment
        with contextlib.suppress(psutil.Error):  # it ended meanwhile
            names = [word[8:] for word in shown.cmdline() if word.startswith('__node:=')]
            process = process_of(shown.pid) if names else None
            if process is not None:
                found[names[0]] = process
    return found


def kill(pid: int) -> None:
    """Kill a process and, if it leads a group of processes, all of the group."""
    with contextlib.suppress(ProcessLookupError):
        if os.getpgid(pid) == pid:
            os.killpg(pid, signal.SIGKILL)
        else:
            os.kill(pid, signal.SIGKILL)


def await_end(pids: Iterable[int], *, patience_s: float) -> None:
    """Wait for processes that were asked to end; kill those left after `patience_s` [s].

    A stopped process is continued, so that it can end in order.
    """
    waiting = list(pids)
    for pid in waiting:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGCONT)
    deadline = time.monotonic() + patience_s
    while waiting and time.monotonic() < deadline:
        time.sleep(POLL_S)
        waiting = [pid for pid in waiting if process_of(pid) is not None]
    for pid in waiting:
        kill(pid)
