"""Tests of the graph's processes: restarts, stopped processes, bounded logs, and a sure end."""

import errno
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

import pytest

from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.processes import GraphProcesses

SLEEPER = """
import sys, time
from porotwin_core.basis.parent import end_with_parent
if {bound}:
    end_with_parent()
print('here', flush=True)
time.sleep(60)
"""

SUPERVISOR = """
import sys, time
from pathlib import Path
from porotwin_hub.launching.graph import NodeDescription
from porotwin_hub.launching.processes import GraphProcesses
with GraphProcesses([NodeDescription('sleeper', 'pretend', 'sleeper')], Path(sys.argv[1])) as graph:
    print(graph.process('sleeper').pid, flush=True)
    time.sleep(60)
"""


def pretend_node(folder: Path, source: str) -> NodeDescription:
    (folder / 'pretend').mkdir()
    (folder / 'pretend' / '__init__.py').touch()
    (folder / 'pretend' / 'sleeper.py').write_text(source)
    return NodeDescription('sleeper', 'pretend', 'sleeper')


def with_path(folder: Path) -> dict[str, str]:
    return {'PYTHONPATH': os.pathsep.join([str(folder), os.environ.get('PYTHONPATH', '')])}


def until(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 20.0
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


def alive(pid: int) -> bool:
    try:
        return Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()[0] != 'Z'
    except FileNotFoundError:
        return False


def restore_signals() -> None:
    """Undo the ignored signals that a test run in the background or under nohup inherits."""
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize(
    ('number', 'bound'),
    [
        (signal.SIGHUP, False),
        (signal.SIGTERM, False),
        (signal.SIGINT, False),
        (signal.SIGKILL, True),
    ],
)
def test_no_node_outlives_its_graph(number: signal.Signals, bound: bool, tmp_path: Path) -> None:
    pretend_node(tmp_path, SLEEPER.format(bound=bound))
    graph = subprocess.Popen(
        [sys.executable, '-c', SUPERVISOR, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, **with_path(tmp_path)},
        preexec_fn=restore_signals,
    )
    assert graph.stdout is not None
    node = int(graph.stdout.readline())
    assert until((tmp_path / 'log' / 'sleeper.log').read_text)
    os.kill(graph.pid, number)
    graph.wait(20)
    assert until(lambda: not alive(node))


def test_a_node_runs_no_file_of_the_users_folder_and_writes_utf_8(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path / 'here'
    here.mkdir()
    (here / 'wave.py').write_text('print("foreign")')
    monkeypatch.chdir(here)
    monkeypatch.setenv('PYTHONIOENCODING', 'ascii')
    node = pretend_node(tmp_path, 'import time, wave\nprint("br\u00f8nn")\ntime.sleep(60)')
    with GraphProcesses([node], tmp_path, environment={'PYTHONPATH': str(tmp_path)}) as graph:
        assert until(lambda: 'nn' in graph.log('sleeper').read_text(errors='replace'))
    assert graph.log('sleeper').read_text() == 'br\u00f8nn\n'


class FullDisk(GraphProcesses):
    """A graph whose logs lie on a full disk."""

    def log(self, name: str) -> Path:
        return Path('/dev/full')


def test_a_full_disk_stops_neither_the_display_nor_a_restart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = 'import sys\nfor n in range(9): print(n, "x" * 99)\nsys.exit(1)'
    node, lines = pretend_node(tmp_path, source), []
    graph = FullDisk(
        [node],
        tmp_path,
        say=lines.append,
        show=['sleeper'],
        environment=with_path(tmp_path),
        restart_pause_s=0.1,
    )
    with graph:
        monkeypatch.setattr(Path, 'write_text', lambda *_, **__: 1 / 0)
        assert until(lambda: sum(line.startswith('8 x') for line in lines) >= 2), lines
    assert sum('cannot be written (No space left' in line for line in lines) <= 3, lines


@pytest.mark.parametrize('number', [errno.ENOSPC, errno.EDQUOT, errno.EROFS])
def test_lines_that_a_full_or_read_only_disk_loses_are_told(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusal: list[int] = []
    lines: list[str] = []
    real = tempfile.TemporaryFile

    def refused(**place: Path) -> IO[bytes]:
        if refusal:
            raise OSError(refusal[0], os.strerror(refusal[0]))
        return real(**place)

    monkeypatch.setattr('tempfile.TemporaryFile', refused)
    refusal.append(number)
    node = pretend_node(tmp_path, SLEEPER.format(bound=False))
    with GraphProcesses([node], tmp_path, say=lines.append, environment=with_path(tmp_path)):
        told = f'takes no data ({os.strerror(number)})'
        assert until(lambda: any(told in line for line in lines)), lines
        refusal.clear()
        assert until(lambda: any('takes data again' in line for line in lines)), lines
    assert sum(told in line for line in lines) == 1


def test_a_closed_terminal_does_not_stop_the_log(tmp_path: Path) -> None:
    def gone(text: str) -> None:
        raise OSError(5, text)

    node = pretend_node(tmp_path, 'for n in range(20000): print("line", n)')
    graph = GraphProcesses(
        [node], tmp_path, say=gone, show=['sleeper'], environment=with_path(tmp_path)
    )
    with graph:
        assert until(lambda: 'line 19999' in graph.log('sleeper').read_text())


def graph_of(folder: Path, source: str, lines: list[str], **settings: float) -> GraphProcesses:
    node = pretend_node(folder, source)
    return GraphProcesses(
        [node], folder, say=lines.append, environment=with_path(folder), **settings
    )


def test_a_node_that_is_killed_ten_times_in_a_row_runs_again(tmp_path: Path) -> None:
    lines: list[str] = []
    with graph_of(tmp_path, SLEEPER.format(bound=False), lines, restart_pause_s=0.001) as graph:
        for _ in range(10):
            killed = graph.process('sleeper')
            killed.kill()
            assert until(lambda before=killed: graph.process('sleeper') is not before), lines
        assert graph.running('sleeper')
    assert sum('ended (-9); starting it again' in line for line in lines) == 10


def test_a_node_that_somebody_ends_is_started_again(tmp_path: Path) -> None:
    lines: list[str] = []
    source = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
print('here', flush=True)
time.sleep(60)
"""
    with graph_of(tmp_path, source, lines, restart_pause_s=0.01) as graph:
        assert until(lambda: 'here' in graph.log('sleeper').read_text())
        ended = graph.process('sleeper')
        ended.terminate()
        assert until(lambda: graph.process('sleeper') is not ended), lines
    assert lines == ['sleeper ended (somebody ended it); starting it again in 0.01 s']


def test_a_stand_in_for_a_rig_that_has_finished_stays_ended(tmp_path: Path) -> None:
    lines: list[str] = []
    pretend_node(tmp_path, 'pass')
    (tmp_path / 'pretend').rename(tmp_path / 'porotwin_rig')
    node = NodeDescription('rig', 'porotwin_rig', 'sleeper')
    environment = with_path(tmp_path)
    with GraphProcesses([node], tmp_path, say=lines.append, environment=environment):
        assert until(lambda: lines == ['rig has ended']), lines


def test_a_stopped_node_is_killed_and_started_again(tmp_path: Path) -> None:
    lines: list[str] = []
    source = SLEEPER.format(bound=False)
    with graph_of(tmp_path, source, lines, restart_pause_s=0.01, stopped_patience_s=0.5) as graph:
        stopped = graph.process('sleeper')
        stopped.send_signal(signal.SIGSTOP)
        assert until(lambda: graph.process('sleeper') is not stopped), lines
    assert any('sleeper was stopped for 0.5 s; killed' in line for line in lines)


def test_a_stopped_node_ends_with_its_graph_in_order(tmp_path: Path) -> None:
    lines: list[str] = []
    with graph_of(tmp_path, SLEEPER.format(bound=False), lines) as graph:
        assert until(lambda: 'here' in graph.log('sleeper').read_text())
        process = graph.process('sleeper')
        process.send_signal(signal.SIGSTOP)
    assert lines == []
    assert process.returncode == -signal.SIGTERM


def test_a_node_that_is_still_loading_ends_without_a_traceback(tmp_path: Path) -> None:
    lines: list[str] = []
    with graph_of(tmp_path, SLEEPER.format(bound=False), lines) as graph:
        assert until(lambda: 'here\n' in graph.log('sleeper').read_text())
    assert graph.log('sleeper').read_text() == 'here\n'


def test_a_graph_in_the_background_ends_in_order(tmp_path: Path) -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as a shell starts a background job
    lines: list[str] = []
    try:
        with graph_of(tmp_path, SLEEPER.format(bound=False), lines) as graph:
            assert until(lambda: 'here' in graph.log('sleeper').read_text())
            os.kill(os.getpid(), signal.SIGINT)
            assert graph.running('sleeper')
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    assert lines == []
    assert graph.process('sleeper').returncode == -signal.SIGTERM


def test_a_node_that_ignores_the_end_is_killed_with_its_children(tmp_path: Path) -> None:
    lines: list[str] = []
    source = """
import signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = subprocess.Popen(['sleep', '600'])
print('child', child.pid, flush=True)
time.sleep(600)
"""
    with graph_of(tmp_path, source, lines, end_patience_s=0.5) as graph:
        assert until(lambda: 'child' in graph.log('sleeper').read_text())
        child = int(graph.log('sleeper').read_text().split()[1])
    assert lines == ['sleeper did not end within 0.5 s and is killed']
    assert until(lambda: not alive(child))


def test_a_node_that_logs_without_end_does_not_fill_the_disk(tmp_path: Path) -> None:
    lines: list[str] = []
    source = """
import time
while True:
    print('x' * 1000, flush=True)
    time.sleep(0.001)
"""
    with graph_of(tmp_path, source, lines, log_limit_bytes=20_000) as graph:
        log = graph.log('sleeper')
        older = log.with_name('sleeper.log.1')
        assert until(older.is_file)
        first = older.stat().st_mtime_ns
        assert until(lambda: older.stat().st_mtime_ns > first)
        assert until(lambda: log.stat().st_size < 20_000)


def test_a_refusal_is_told_once(tmp_path: Path) -> None:
    lines: list[str] = []
    source = "import sys\nprint('error: no such rig', flush=True)\nsys.exit(2)"
    node = pretend_node(tmp_path, source)
    graph = GraphProcesses(
        [node], tmp_path, say=lines.append, show=['sleeper'], environment=with_path(tmp_path)
    )
    with graph:
        assert until(lambda: bool(graph.failed)), lines
    assert graph.refusal() == 'sleeper cannot run: no such rig'
    assert lines == []
    assert graph.refusal(optional=['sleeper']) is None
    assert graph.refusal(optional=['sleeper']) is None
    assert lines == ['sleeper cannot run, going on without: no such rig']


def test_a_node_that_is_refused_at_a_restart_is_started_again(tmp_path: Path) -> None:
    lines: list[str] = []
    source = """
import sys, time
from pathlib import Path
starts = Path(__file__).with_name('starts')
with starts.open('a') as file:
    file.write('x')
if 1 < len(starts.read_text()) < 4:
    print('error: a stranger holds the name', flush=True)
    sys.exit(2)
print('here', flush=True)
time.sleep(60)
"""
    with graph_of(tmp_path, source, lines, restart_pause_s=0.01) as graph:
        assert until(lambda: 'here' in graph.log('sleeper').read_text())
        graph.process('sleeper').kill()
        assert until(lambda: graph.log('sleeper').read_text().count('here') == 2), lines
        assert graph.running('sleeper')
        assert not graph.failed
    assert [line for line in lines if 'a stranger holds the name' in line] == [
        f'sleeper ended (a stranger holds the name); starting it again in {pause} s'
        for pause in (0.02, 0.04)
    ]
