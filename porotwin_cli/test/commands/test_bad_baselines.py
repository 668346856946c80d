"""./porotwin image and calibrate: baselines that spoil every map are named and refused."""

import shutil
from pathlib import Path

import pytest

from porotwin_cli.commands import calibrate, image
from porotwin_core.basis.errors import InputError
from porotwin_imaging.tracer.calibration import Calibration, save_calibration

pytestmark = pytest.mark.usefixtures('undrawn')


@pytest.fixture
def folder(experiment: Path, tmp_path: Path) -> Path:
    """A copy of the experiment, to be spoiled."""
    copy = tmp_path / 'experiment'
    shutil.copytree(experiment, copy)
    return copy


def _listed(folder: Path, role: str) -> list[str]:
    """Return the paths of the photographs of a role, as imaging.csv lists them."""
    rows = [line.split(',') for line in (folder / 'imaging.csv').read_text().splitlines()[1:]]
    return [row[1] for row in rows if row[2] == role]


@pytest.mark.parametrize('content', [b'', b'cut'])
def test_the_file_of_a_bad_baseline_is_named(folder: Path, content: bytes) -> None:
    bad = folder / _listed(folder, 'baseline')[0]
    bad.write_bytes(bad.read_bytes()[:20_000] if content else b'')
    with pytest.raises(InputError, match=f'^{bad}: photograph of '):
        image.command(folder, folder.parent / 'maps.nc', '40x24')
    with pytest.raises(InputError, match=f'^{bad}: photograph of '):
        calibrate.command(folder)


def test_a_further_baseline_with_tracer_is_named(folder: Path) -> None:
    first, last = _listed(folder, 'baseline')[0], _listed(folder, 'state')[-1]
    table = folder / 'imaging.csv'
    with table.open('a') as file:
        file.write(f'1,{last},baseline\n')
    words = f'^{folder / last}: differs from {folder / first} on .* % of the sand'
    with pytest.raises(InputError, match=words):
        image.command(folder, folder.parent / 'maps.nc', '40x24')
    with pytest.raises(InputError, match=words):
        calibrate.command(folder)


@pytest.mark.parametrize('with_tracer', [False, True])
def test_tracer_in_the_only_baseline_is_told(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], with_tracer: bool
) -> None:
    calibration, table = tmp_path / 'calibration.yaml', folder / 'imaging.csv'
    save_calibration(Calibration(), calibration)
    if with_tracer:
        head, _, *states = table.read_text().splitlines()
        early = states[2].split(',')[1]
        table.write_text('\n'.join([head, f'-60,{early},baseline', *states[3:]]) + '\n')
    image.command(folder, tmp_path / 'maps.nc', '187x112', calibration)
    told = 'of the tracer at well injector while it injects: the baseline shows tracer already'
    assert (told in capsys.readouterr().err) is with_tracer
