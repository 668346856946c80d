"""Tests of ./porotwin runs."""

import json
import shutil
from pathlib import Path

from cli_examples import porotwin

SAMPLE = Path(__file__).resolve().parents[3] / 'bags' / 'sample'


def test_recordings_are_listed_and_a_broken_one_does_not_stop_the_list(tmp_path: Path) -> None:
    shutil.copytree(SAMPLE, tmp_path / 'morning' / 'sample')
    (tmp_path / 'broken.mcap').write_text('no bag')
    told = porotwin('runs', tmp_path)
    assert told.returncode == 0, told.stderr
    assert '1 recordings' in told.stdout
    assert 'morning/sample' in told.stdout
    assert f'{tmp_path}/broken.mcap: not an MCAP file' in told.stderr
    found = json.loads(porotwin('runs', tmp_path, '--json').stdout)['recordings']
    (sample,) = [entry for entry in found if entry['state'] == 'complete']
    assert (sample['photographs'], sample['maps'], sample['setpoints']) == (13, 13, 13)
    assert sample['duration_s'] == 360.0
    assert sample['rig'] == 'small'


def test_a_folder_that_is_not_there_is_refused() -> None:
    result = porotwin('runs', '/nowhere')
    assert result.returncode == 2
    assert '/nowhere: no such folder' in result.stderr
