"""Tests of the line about memory that is too small."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from porotwin_cli.memory_limit import LEAST_BYTES, refuse_small_memory


def test_a_shell_with_little_memory_is_told_so_in_one_line() -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (800_000_000, 800_000_000))

    done = subprocess.run(
        [sys.executable, '-m', 'porotwin_cli', '--help'],
        preexec_fn=limit,
        capture_output=True,
        text=True,
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.count('\n') == 1
    assert 'the shell allows 800 MB of memory' in done.stderr


def test_the_limit_of_a_container_counts_too(tmp_path: Path, capsys) -> None:
    for text in ('max', str(LEAST_BYTES)):
        (tmp_path / 'memory.max').write_text(text)
        refuse_small_memory(tmp_path / 'memory.max')
    (tmp_path / 'memory.max').write_text(str(LEAST_BYTES - 1))
    with pytest.raises(SystemExit) as end:
        refuse_small_memory(tmp_path / 'memory.max')
    assert end.value.code == 1
    assert 'the container allows' in capsys.readouterr().err
