"""Tests of docs/formats.md: its examples are valid files, and its tables name the real columns."""

import re
from pathlib import Path

import netCDF4
import pytest

from porotwin_core.rig import load_rig
from porotwin_imaging.tracer.calibration import load_calibration
from porotwin_recording.experiment.bag_conversion import export_bag
from porotwin_recording.mcap.bag_reader import BagReader
from porotwin_recording.tables.photos import read_photos
from porotwin_recording.tables.rates import read_rates

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / 'docs' / 'formats.md').read_text(encoding='utf-8')


def example(beginning: str) -> str:
    """Return the code block that begins with a text."""
    blocks = re.findall(r'```\w*\n(.*?)```', TEXT, re.DOTALL)
    (found,) = [block for block in blocks if block.startswith(beginning)]
    return found


def section(title: str) -> str:
    """Return the text below a heading, up to the next one."""
    return re.split(r'^#+ ', TEXT.partition(f' {title}\n')[2], maxsplit=1, flags=re.MULTILINE)[0]


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    (tmp_path / 'rig.yaml').write_text(example('name: small'))
    return tmp_path / 'rig.yaml'


def test_the_shortest_rig_is_valid(rig_file: Path) -> None:
    assert load_rig(rig_file).wells.keys() == {'injector', 'producer'}


def test_the_rates_are_valid(rig_file: Path, tmp_path: Path) -> None:
    (tmp_path / 'rates.csv').write_text(example('time_s,well'))
    schedule = read_rates(tmp_path / 'rates.csv', load_rig(rig_file).wells)
    assert len(schedule.rows) == 4


def test_the_photographs_are_valid(tmp_path: Path) -> None:
    table = example('time_s,path,role\n')
    (tmp_path / 'imaging.csv').write_text(table)
    (tmp_path / 'photos').mkdir()
    for name in re.findall(r'photos/\S+?\.jpg', table):
        (tmp_path / name).touch()
    assert [photo.role for photo in read_photos(tmp_path)] == ['baseline', 'state', 'state']


def test_the_calibration_is_valid(tmp_path: Path) -> None:
    (tmp_path / 'calibration.yaml').write_text(example('schema: 2\nmade'))
    assert load_calibration(tmp_path / 'calibration.yaml').scale_error == 0.009


def test_the_tables_name_the_files_variables_and_attributes_of_an_export(tmp_path: Path) -> None:
    export_bag(ROOT / 'bags' / 'sample', tmp_path / 'experiment')
    for path in (tmp_path / 'experiment').iterdir():
        assert path.name in section('Experiment folder')
    with netCDF4.Dataset(tmp_path / 'experiment' / 'concentration.nc') as dataset:
        described = section('concentration.nc')
        for name, variable in dataset.variables.items():
            assert f'| `{name}` | {", ".join(variable.dimensions)}' in described
            assert str(variable.dtype) in described
            assert all(f'`{attribute}`' in described for attribute in variable.ncattrs())


def test_the_tables_name_all_topics_of_the_sample() -> None:
    for name, topic in BagReader(ROOT / 'bags' / 'sample').topics.items():
        if name.startswith('/porotwin/'):
            short = topic.type_name.replace('/msg/', '/')
            assert f'| `{name.removeprefix("/porotwin/")}` | `{short}` |' in section('Bags')
