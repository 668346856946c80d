"""./porotwin compare and archive."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli_examples import porotwin
from recording_examples import controlled_rig

from porotwin_cli.recorded.run_comparison import compare_runs
from porotwin_recording.experiment.experiment_folder import write_folder
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.recorded_data import RecordedData
from porotwin_siblings.zone_measure import ZoneMeasure

ZONE_FIGURES = ('tracer in the zone at the end [ml]', 'dose in the zone [ml min]')


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


def test_the_noise_of_clean_sand_is_no_tracer_in_the_zone(tmp_path: Path) -> None:
    rig = controlled_rig()
    grid = rig.grid(40, 30)
    noise = np.random.default_rng(5).normal(0.0, 0.03, (9, *grid.shape))
    plume = np.zeros(grid.shape)
    plume[:, 30:] = 0.8
    for name, true in (('clean', np.zeros(grid.shape)), ('plume', plume)):
        values = np.clip(true + noise, 0.0, 1.0).astype(np.float32)
        maps = ConcentrationMaps(60.0 * np.arange(9.0), grid, lambda a, b, v=values: v[a:b])
        write_folder(tmp_path / name, RecordedData(rig=rig, maps=maps))
    found = compare_runs(tmp_path / 'clean', tmp_path / 'plume').figures
    clean, seen = (figures['tracer in the zone at the end [ml]'] for figures in found)
    held = 1e6 * ZoneMeasure.of(rig, grid).tracer(plume)
    assert seen == pytest.approx(held, rel=0.03)
    assert clean < 0.002 * held, 'the mean of the noise alone would be 0.015 of it'


def test_tracer_that_comes_at_the_end_is_a_dose(tmp_path: Path) -> None:
    """Before it, the maps hold less than the mean of the noise in the zone, and more elsewhere."""
    rig = controlled_rig()
    grid = rig.grid(40, 30)
    inside = ZoneMeasure.of(rig, grid).pores > 0.0
    values = np.where(inside, 0.0, 0.02) * np.ones((9, 1, 1))
    values += np.abs(np.random.default_rng(5).normal(0.0, 0.005, values.shape)) * ~inside
    values[-1] += 0.04 * inside
    maps = ConcentrationMaps(60.0 * np.arange(9.0), grid, lambda a, b: values[a:b])
    write_folder(tmp_path / 'late', RecordedData(rig=rig, maps=maps))
    figures, _ = compare_runs(tmp_path / 'late', tmp_path / 'late').figures
    end, dose = (figures[name] for name in ZONE_FIGURES)
    assert end > 0.0
    assert dose == pytest.approx(0.5 * end)


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
    assert 'maps with tracer at 12 common times differ by 0.0 %' in told.stdout
