"""The selection of frames, and the filling of unseen cells."""

from pathlib import Path

import numpy as np
import pytest
from diagnosis_examples import SMALL

from porotwin_core.basis.errors import InputError
from porotwin_core.model.tracer_share import tracer_share
from porotwin_diagnosis.data.observed_maps import (
    evenly_spread,
    filled_map,
    observed_maps,
)
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps

GRID = SMALL.grid(20, 12)


def recording_of(times, maps):
    stored = ConcentrationMaps(np.array(times), GRID, lambda start, stop: maps[start:stop])
    return Recording(SMALL, maps=stored, source=Path('run'))


def test_indices_are_spread_evenly_from_the_first_to_the_last():
    assert list(evenly_spread(np.arange(10), 4)) == [0, 3, 6, 9]
    assert list(evenly_spread(np.arange(3), 4)) == [0, 1, 2]


def test_an_unseen_cell_takes_the_mean_of_its_surroundings():
    frame = np.full(GRID.shape, 0.4)
    frame[3:6, 4:8] = np.nan
    np.testing.assert_allclose(filled_map(frame, GRID), 0.4)


def test_the_share_of_cells_with_tracer_is_counted():
    frame = np.zeros(GRID.shape)
    frame[:, :5] = 0.9
    assert tracer_share(frame) == pytest.approx(0.25)


def test_blocked_frames_and_bursts_are_left_out():
    maps = np.stack([np.full(GRID.shape, 0.1 * n) for n in range(6)])
    maps[2] = np.nan
    times, chosen, seen = observed_maps(recording_of([0, 30, 60, 90, 91, 120], maps), GRID, 6)
    assert list(times) == [0, 30, 90, 120]
    assert [frame.mean() for frame in chosen] == pytest.approx([0.0, 0.1, 0.3, 0.5])
    assert all((share == 1.0).all() for share in seen)


def test_a_recording_with_one_seen_map_is_refused():
    maps = np.full((4, *GRID.shape), np.nan)
    maps[1] = 0.5
    with pytest.raises(InputError, match='fewer than two maps'):
        observed_maps(recording_of([0, 30, 60, 90], maps), GRID, 4)
