"""Maps of phases as text."""

from pathlib import Path

import pytest

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.phase_csv import read_phase_csv, read_phase_series


def test_a_series_is_read_by_time_with_the_lower_row_first(tmp_path: Path) -> None:
    (tmp_path / 'segmentation_010800s.csv').write_text('# words\n0,1,\n2,0,\n')
    (tmp_path / 'segmentation_000300s.csv').write_text('0,0\n0,0\n')
    series = read_phase_series(tmp_path, 3)
    assert list(series) == [300.0, 10800.0]
    assert series[10800.0].tolist() == [[2, 0], [0, 1]]


@pytest.mark.parametrize('text', ['', 'a,b', '0,3', '0,1\n0', '0.5,1'])
def test_another_table_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / 'map_0s.csv'
    path.write_text(text)
    with pytest.raises(InputError, match='no map of phases'):
        read_phase_csv(path, 3)


def test_a_folder_without_maps_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='names end in the time'):
        read_phase_series(tmp_path, 3)
