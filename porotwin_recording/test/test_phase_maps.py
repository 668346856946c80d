"""Maps of phases on disk."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_recording.tables.phase_maps import NO_PHASE, PhaseMapWriter

GRID = Grid(4, 3, 0.4, 0.3)
PHASES = ('water', 'dissolved', 'gas')
REASONS = ('seen', 'covered')


def test_numbers_and_their_meanings_come_back(tmp_path: Path) -> None:
    phase = np.array([[0, 0, 1, 2], [0, 1, 2, 2], [0, 0, 0, NO_PHASE]], np.uint8)
    confidence = np.where(phase < NO_PHASE, 0.75, np.nan).astype(np.float32)
    path = tmp_path / 'phases.nc'
    with PhaseMapWriter(path, GRID, PHASES, REASONS, colours=['gas: bright']) as writer:
        writer.append(5.0, phase, confidence, (phase == NO_PHASE).astype(np.uint8))
    with netCDF4.Dataset(tmp_path / 'phases.nc') as file:
        stored = file['phase'][0]
        assert file['phase'].flag_meanings.split() == list(PHASES)
        assert file['phase'].flag_values.tolist() == [0, 1, 2]
        np.testing.assert_array_equal(stored.filled(NO_PHASE), phase)
        np.testing.assert_array_equal(stored.mask, phase == NO_PHASE)
        np.testing.assert_array_equal(file['confidence'][0].filled(np.nan), confidence)
        assert file['reason'][0].tolist()[2] == [0, 0, 0, 1]
        assert file['time'][:].tolist() == [5.0]
        np.testing.assert_allclose(file['z'][:], GRID.z)


def test_a_file_that_failed_is_not_there(tmp_path: Path) -> None:
    nothing = np.zeros(GRID.shape)
    with (
        pytest.raises(InputError, match='times must increase'),
        PhaseMapWriter(tmp_path / 'phases.nc', GRID, PHASES, REASONS) as writer,
    ):
        writer.append(5.0, nothing, nothing, nothing)
        writer.append(5.0, nothing, nothing, nothing)
    assert not list(tmp_path.iterdir())


def test_a_map_of_another_grid_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match=r'map of shape \(4, 3\) at 5 s; the grid has \(3, 4\)'),
        PhaseMapWriter(tmp_path / 'phases.nc', GRID, PHASES, REASONS) as writer,
    ):
        writer.append(5.0, np.zeros(GRID.shape), np.zeros((4, 3)), np.zeros(GRID.shape))
