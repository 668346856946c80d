"""Maps in parts: what a kill leaves is used again, and the file is that of an undisturbed work."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from recording_examples import bench_rig

from porotwin_core.basis.errors import InputError
from porotwin_recording.tables.concentration import MAPS_AT_ONCE, open_maps
from porotwin_recording.tables.map_parts import MapParts

RIG = bench_rig()
GRID = RIG.grid(6, 4)
MAPS = np.random.default_rng(5).random((2 * MAPS_AT_ONCE + 5, *GRID.shape)).astype(np.float32)


def parts(path: Path, source: str = 'bag') -> MapParts:
    """Return a writer of maps from `source`."""
    return MapParts(path, RIG, GRID, source={'photographs': source, 'rig.yaml': 'the same'})


def add(writer: MapParts, numbers: Iterable[int]) -> None:
    """Append maps by their numbers, with deviations."""
    for number in numbers:
        writer.append(30.0 * number, MAPS[number], deviation=0.1 * MAPS[number])


def test_a_killed_work_goes_on_behind_its_last_complete_part(tmp_path: Path) -> None:
    path = tmp_path / 'maps.nc'
    add(parts(path), range(MAPS_AT_ONCE))
    (tmp_path / 'maps.nc.parts' / '000001.nc.partial').write_bytes(b'torn by a kill')
    again = parts(path)
    assert again.earlier == tuple(30.0 * n for n in range(MAPS_AT_ONCE))
    with again:
        add(again, range(MAPS_AT_ONCE, len(MAPS)))
    maps = open_maps(path, RIG)
    np.testing.assert_array_equal(maps[:], MAPS)
    np.testing.assert_array_equal(maps.deviation, np.float32(0.1) * MAPS)
    assert [file.name for file in tmp_path.iterdir()] == ['maps.nc']


def test_an_interrupt_keeps_every_map(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), parts(tmp_path / 'maps.nc') as writer:
        add(writer, range(3))
        raise KeyboardInterrupt
    assert not (tmp_path / 'maps.nc').exists()
    assert len(parts(tmp_path / 'maps.nc').earlier) == 3


def test_parts_of_another_source_are_not_used(tmp_path: Path) -> None:
    add(parts(tmp_path / 'maps.nc', 'another bag'), range(MAPS_AT_ONCE))
    with parts(tmp_path / 'maps.nc') as writer:
        assert writer.earlier == ()
        assert writer.changed == ('photographs',)
        add(writer, range(2))
    assert len(open_maps(tmp_path / 'maps.nc', RIG)) == 2


def test_times_increase_over_the_parts(tmp_path: Path) -> None:
    writer = parts(tmp_path / 'maps.nc')
    add(writer, range(MAPS_AT_ONCE))
    with pytest.raises(InputError, match='times must increase'):
        add(writer, [3])


def test_nothing_stays_of_a_work_without_maps(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), parts(tmp_path / 'maps.nc'):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
