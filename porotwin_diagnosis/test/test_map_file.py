"""Tests of the maps in a file: in order, thinned, and of a bounded size."""

import os

import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_diagnosis.data.map_file import MapFile


def test_maps_come_back_as_they_went_in(tmp_path):
    maps = MapFile((2, 3), 10, tmp_path)
    stack = np.random.default_rng(1).random((5, 2, 3)).astype(np.float32)
    stack[2, 1] = np.nan
    for number, values in enumerate(stack):
        maps.append(30.0 * number, values)
    np.testing.assert_array_equal(maps.read(0, 5), stack)
    np.testing.assert_array_equal(maps.read(2, 4), stack[2:4])
    assert list(tmp_path.iterdir()) == []
    maps.clear()
    assert len(maps) == 0


def test_many_maps_are_thinned_evenly_in_a_file_that_does_not_grow(tmp_path, monkeypatch):
    written = []
    pwrite = os.pwrite
    monkeypatch.setattr(
        os, 'pwrite', lambda file, data, at: written.append(at) or pwrite(file, data, at)
    )
    maps = MapFile((2, 3), 10, tmp_path)
    for number in range(500):
        maps.append(float(number), np.full((2, 3), number))
    assert max(written) <= 10 * 24
    assert (maps.times[0], maps.times[-1]) == (0.0, 499.0)
    assert 5 <= len(maps) <= 10
    assert maps.read(0, len(maps))[:, 0, 0].tolist() == list(maps.times)


def test_a_full_disk_costs_one_map_and_one_line(monkeypatch):
    maps = MapFile((2, 3), 10)
    with monkeypatch.context() as full, pytest.raises(InputError, match='is full; free some space'):
        full.setattr(os, 'pwrite', lambda *_: 3)
        maps.append(0.0, np.zeros((2, 3)))
    maps.append(30.0, np.ones((2, 3)))
    assert maps.times == (30.0,)
