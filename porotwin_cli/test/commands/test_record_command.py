"""./porotwin record."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli_examples import porotwin
from patience import PATIENCE_S, until

from porotwin_cli.commands import record
from porotwin_cli.interrupts import INTERRUPTED
from porotwin_cli.running.foreground import run_node


@pytest.mark.graph
def test_record_counts_its_messages(tmp_path: Path) -> None:
    arguments = ['record', '--output', tmp_path / 'bag', '--json']
    process = subprocess.Popen(
        [sys.executable, '-m', 'porotwin_cli', *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    until(lambda: list(tmp_path.glob('bag/*.mcap')))
    os.killpg(process.pid, signal.SIGINT)  # like Ctrl-C in a terminal
    output, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert json.loads(output)['messages'] >= 0


def test_ctrl_c_before_the_bag_is_begun_is_an_interrupt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record, 'run_node', lambda *_, **__: None)
    result = porotwin('record', '--output', tmp_path / 'bag')
    assert result.returncode == INTERRUPTED
    assert result.stderr.splitlines()[-1] == 'porotwin: interrupted'


def test_ctrl_c_while_a_node_loads_is_an_interrupt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    press = 'import os, signal, time; os.kill(os.getppid(), signal.SIGINT); time.sleep(60)'
    (tmp_path / 'slow_node.py').write_text(press)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    with pytest.raises(KeyboardInterrupt):
        run_node('slow_node', 'slow', {})
    assert capfd.readouterr().err == ''
