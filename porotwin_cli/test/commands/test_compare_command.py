"""./porotwin compare and archive."""

import json
import shutil
from pathlib import Path

import pytest
from cli_examples import porotwin

from porotwin_cli.recorded.run_comparison import compare_runs


def test_two_runs_differ_in_rates_and_maps(experiment: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(experiment, tmp_path / 'other'))
    rates = other / 'rates.csv'
    head, *rows = rates.read_text().splitlines()
    halved = [row.split(',') for row in rows]
    lines = [','.join([t, well, str(float(q) / 2), c]) for t, well, q, c in halved]
    rates.write_text('\n'.join([head, *lines]) + '\n')
    found = compare_runs(experiment, other)
    stock = [figures['stock injected [ml]'] for figures in found.figures]
    assert stock[1] == pytest.approx(stock[0] / 2)
    assert found.keys == ()
    assert max(found.distances.values(), default=0.0) == 0.0


def test_the_sample_is_packed_opened_and_the_same(tmp_path: Path) -> None:
    sample = Path(__file__).resolve().parents[3] / 'bags' / 'sample'
    packed = porotwin('archive', sample, '--output', tmp_path / 'sample.zip')
    assert packed.returncode == 0, packed.stderr
    opened = porotwin('archive', tmp_path / 'sample.zip', '--output', tmp_path / 'back', '--json')
    assert opened.returncode == 0, opened.stderr
    (recording,) = json.loads(opened.stdout)['recordings']
    told = porotwin('compare', sample, recording)
    assert told.returncode == 0, told.stderr
    assert 'the rigs are the same' in told.stdout
    assert 'maps at 13 common times differ by 0.0 %' in told.stdout
