"""Tests of runs as one file."""

import zipfile
from pathlib import Path

import pytest

from porotwin_core import __version__
from porotwin_core.basis.errors import InputError
from porotwin_recording.experiment.run_archive import VERSIONS_FILE, open_archive, write_archive


@pytest.fixture
def run(tmp_path: Path) -> Path:
    run = tmp_path / 'run'
    for name in ('bag/bag_0.mcap', 'diagnoses/1/report.html', 'page_token', '.hidden', 'rig.yaml'):
        (run / name).parent.mkdir(parents=True, exist_ok=True)
        (run / name).write_text(name)
    (run / 'link').symlink_to('/etc/hostname')
    return run


def test_a_run_comes_back_whole_but_for_its_token(run: Path, tmp_path: Path) -> None:
    calibration = tmp_path / 'calibration.yaml'
    calibration.write_text('schema: 2')
    assert write_archive(run, tmp_path / 'run.zip', beside=[calibration]) == 4
    told = open_archive(tmp_path / 'run.zip', tmp_path / 'back')
    assert told['porotwin'] == __version__
    names = {str(p.relative_to(tmp_path / 'back')) for p in (tmp_path / 'back').rglob('*.*')}
    assert names == {
        'bag/bag_0.mcap',
        'diagnoses/1/report.html',
        'rig.yaml',
        'beside/calibration.yaml',
        VERSIONS_FILE,
    }
    assert (tmp_path / 'back' / 'rig.yaml').read_text() == 'rig.yaml'


def test_an_archive_replaces_nothing(run: Path, tmp_path: Path) -> None:
    write_archive(run, tmp_path / 'run.zip')
    with pytest.raises(InputError, match='exists already'):
        write_archive(run, tmp_path / 'run.zip')
    with pytest.raises(InputError, match='exists already'):
        open_archive(tmp_path / 'run.zip', run)
    with pytest.raises(InputError, match='holds no files'):
        write_archive(tmp_path / 'nothing', tmp_path / 'nothing.zip')


@pytest.mark.parametrize('damage', ['cut', 'other'])
def test_a_file_that_is_no_archive_leaves_no_folder(run: Path, tmp_path: Path, damage: str) -> None:
    file = tmp_path / 'run.zip'
    write_archive(run, file)
    if damage == 'cut':
        file.write_bytes(file.read_bytes()[:-100])
    else:
        with zipfile.ZipFile(file, 'w') as archive:
            archive.writestr('../outside', 'x')
    with pytest.raises(InputError, match=r'run\.zip: '):
        open_archive(file, tmp_path / 'back')
    assert not (tmp_path / 'back').exists()
    assert not (tmp_path.parent / 'outside').exists()
