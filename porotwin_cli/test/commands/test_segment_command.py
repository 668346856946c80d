"""./porotwin segment."""

import csv
import json
from pathlib import Path

import netCDF4
from cli_examples import porotwin


def test_segment_writes_maps_a_table_and_a_picture(experiment: Path, tmp_path: Path) -> None:
    output, series = tmp_path / 'phases.nc', tmp_path / 'series'
    series.mkdir()
    for time, row in ((300, '0,0'), (600, '0,1')):
        (series / f'map_{time:06}s.csv').write_text(row)
    result = porotwin(
        'segment', experiment, '--output', output, '--grid', '94x56', '--series', series, '--json'
    )
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    assert answer['refused'] == []
    assert 'gas: no such colour' in result.stderr  # tracer is no gas
    assert 'is this tracer?' in result.stderr
    assert answer['perhaps_tracer'] is True
    assert {match['map_time_s'] for match in answer['dates'].values()} <= {300.0, 600.0}
    assert len(answer['dates']) == len(answer['phases']) / 3
    with (tmp_path / 'phases.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['phase'] for row in rows[:3]] == ['water', 'dissolved', 'gas']
    assert float(rows[-2]['area_m2']) > 0.0
    assert float(rows[-1]['area_m2']) == 0.0
    assert (tmp_path / 'phases.png').read_bytes().startswith(b'\x89PNG')
    with netCDF4.Dataset(output) as dataset:
        assert len(dataset['time']) == len(rows) / 3


def test_a_box_that_is_none_is_refused(experiment: Path, tmp_path: Path) -> None:
    output = tmp_path / 'phases.nc'
    result = porotwin('segment', experiment, '--output', output, '--gas', '0.3,0.1,0.2,0.4')
    assert result.returncode == 2
    assert "--gas '0.3,0.1,0.2,0.4'" in result.stderr
    assert not output.exists()
