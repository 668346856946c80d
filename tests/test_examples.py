"""Every script of examples/ runs, keeps its own assertions, and writes its picture."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
SCRIPTS = sorted(path for path in EXAMPLES.glob('*.py') if path.name != 'picture.py')


def test_there_are_enough_examples() -> None:
    assert len(SCRIPTS) >= 8


@pytest.mark.slow
@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_writes_its_picture(script: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(script), str(tmp_path)]
    ran = subprocess.run(command, check=False, capture_output=True, text=True, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    picture = tmp_path / f'{script.stem}.png'
    assert picture.read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize('script', SCRIPTS, ids=lambda path: path.stem)
def test_an_example_is_shown_in_the_list(script: Path) -> None:
    text = (EXAMPLES / 'README.md').read_text(encoding='utf-8')
    assert f'({script.name})' in text
    assert f'(pictures/{script.stem}.png)' in text
