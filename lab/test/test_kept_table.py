"""Tables of benches on disk: what stands beside them, and which rows are named."""

import json
from pathlib import Path

import pytest

from lab.benches import kept_table
from lab.benches.kept_table import keep_table, last_duration, slower_rows


def table(**seconds: float) -> list[dict[str, object]]:
    return [{'stage': name, 'median_s': value, 'memory_mb': ''} for name, value in seconds.items()]


def test_a_table_is_kept_with_its_machine_versions_and_date(tmp_path: Path) -> None:
    (line,) = keep_table('imaging', table(decode=0.1), 3.0, tmp_path)
    (file,) = tmp_path.glob('imaging-*.json')
    assert str(file) in line
    kept = json.loads(file.read_text())
    assert kept['rows'] == table(decode=0.1)
    assert kept['date'] and kept['machine'] and kept['versions']['numba']


def test_the_next_table_is_compared_with_the_last_one(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(kept_table, 'yardstick', lambda: 0.2)
    older = {'date': '2026-01-01', 'machine': 'another', 'yardstick_s': 0.2}
    older |= {'seconds': 7.0, 'rows': table(a=1.0, b=1.0, c=1.0), 'versions': {'numpy': '0.9'}}
    (tmp_path / 'imaging-20260101-000000.json').write_text(json.dumps(older))
    assert last_duration('imaging', tmp_path) == 7.0
    about, slower = keep_table('imaging', table(a=1.0, b=1.5, c=1.0), 3.0, tmp_path)
    assert 'another' in about
    assert 'numpy 0.9 then' in about
    assert 'numba' not in about
    assert 'b' in slower
    assert '50 %' in slower


def test_a_busy_machine_makes_no_row_slower() -> None:
    assert slower_rows(table(a=2.0, b=2.1, c=1.9), table(a=1.0, b=1.0, c=1.0), 2.0) == []


def test_a_ratio_to_a_baseline_of_the_same_run_counts_alone() -> None:
    before = [{'model': 'fast', 'cpu_s': 1.0, 'ratio_to_plain': 0.1}]
    after = [{'model': 'fast', 'cpu_s': 9.0, 'ratio_to_plain': 0.11}]
    assert slower_rows(after, before, 9.0) == []
    assert len(slower_rows([{**after[0], 'ratio_to_plain': 0.13}], before, 1.0)) == 1
    assert slower_rows([{**after[0], 'ratio_to_plain': None}], before, 1.0) == []


def test_rows_that_all_became_slower_are_named() -> None:
    before, after = [{'cycle, median [s]': 0.3}], [{'cycle, median [s]': 0.6}]
    assert len(slower_rows(after, before, 1.0)) == 1


@pytest.mark.parametrize(
    'damaged',
    [
        b'{"rows": [',
        b'[]',
        b'{"date": 1, "machine": 2, "versions": {}, "yardstick_s": 0, "rows": []}',
        b'{"date": 1, "machine": 2, "versions": {}, "yardstick_s": "x", "rows": []}',
        b'{"date": 1, "machine": 2, "versions": {}, "yardstick_s": 1.0, "rows": null}',
        b'{"date": 1, "machine": 2, "versions": {}, "yardstick_s": 1.0, "rows": [3]}',
    ],
)
def test_a_damaged_table_is_told(tmp_path: Path, damaged: bytes) -> None:
    (tmp_path / 'imaging-20260101-000000.json').write_bytes(damaged)
    assert last_duration('imaging', tmp_path) is None
    (line,) = keep_table('imaging', table(a=1.0), 3.0, tmp_path)
    assert 'imaging-20260101-000000.json is damaged' in line
