"""./porotwin image and calibrate: baselines that spoil every map are named and refused."""

import shutil
from pathlib import Path

import pytest

from porotwin_cli.commands import calibrate, image
from porotwin_core.errors import InputError


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
