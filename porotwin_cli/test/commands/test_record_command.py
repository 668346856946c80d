"""./porotwin record."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


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
    deadline = time.monotonic() + 60.0
    while not list(tmp_path.glob('bag/*.mcap')) and time.monotonic() < deadline:
        time.sleep(0.1)
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGINT)  # like Ctrl-C in a terminal
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert json.loads(output)['messages'] >= 0
