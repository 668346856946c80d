"""The notebooks run: each cell in its order, in a process of its own, as a kernel would run it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / 'examples').glob('notebooks/*.ipynb'))


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) == 3


@pytest.mark.slow
@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path) -> None:
    cells = json.loads(path.read_text(encoding='utf-8'))['cells']
    code = [''.join(cell['source']) for cell in cells if cell['cell_type'] == 'code']
    assert all(cell.get('outputs', []) == [] for cell in cells)
    script = '\n'.join(['import matplotlib; matplotlib.use("Agg")', *code])
    ran = subprocess.run(
        [sys.executable, '-W', 'error::DeprecationWarning:__main__', '-c', script],
        cwd=path.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
