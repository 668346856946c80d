"""./porotwin calibrate: photographs that do not belong together."""

import shutil
from pathlib import Path

import cv2
import pytest
from cli_examples import porotwin


@pytest.mark.parametrize('role', ['baseline', 'state'])
def test_photographs_of_another_size_are_named(experiment: Path, tmp_path: Path, role: str) -> None:
    folder = tmp_path / 'experiment'
    shutil.copytree(experiment, folder)
    rows = [line.split(',') for line in (folder / 'imaging.csv').read_text().splitlines()[1:]]
    changed = [row[1] for row in rows if row[2] == role]
    if role == 'baseline':  # a second baseline
        with (folder / 'imaging.csv').open('a') as table:
            table.write('1,second.png,baseline\n')
        shutil.copy(folder / changed[0], folder / 'second.png')
        changed = ['second.png']
    for name in changed:
        picture = cv2.imread(str(folder / name))
        cv2.imwrite(str(folder / name), picture[::2, ::2])
    result = porotwin('calibrate', folder)
    assert result.returncode == 2
    assert f'{folder / changed[0]}: photograph of 400 x' in result.stderr
