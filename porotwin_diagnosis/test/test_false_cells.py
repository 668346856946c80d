"""Single cells that no tracer explains are not seen, and everything else stays."""

import numpy as np
from diagnosis_examples import with_frames
from hypothesis import given
from hypothesis import strategies as st

from porotwin_checks.checks.lone_cells import false_cells
from porotwin_checks.near_wells import cells_near
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_recording.experiment.recording import open_recording

SHAPE = (30, 60)
NO_WELLS = np.zeros(SHAPE, dtype=bool)


def test_glaring_and_lone_cells_are_not_seen(quiet):
    recording = open_recording(quiet)
    maps = np.array(recording.concentration)
    glare, dead = (20, 30), (maps.shape[1] - 3, 5)
    maps[(slice(None), *glare)] = 900.0
    maps[(slice(None), *dead)] = 1.0
    read = without_false_cells(with_frames(recording, np.array(recording.times), maps))
    seen = np.array(read.concentration)
    assert {tuple(cell) for cell in np.argwhere(np.isnan(seen).any(axis=0))} == {glare, dead}
    np.testing.assert_array_equal(seen[np.isfinite(seen)], maps[np.isfinite(seen)])


def test_maps_in_another_scale_stay(quiet):
    percent = 100.0 * open_recording(quiet).concentration[-1]
    assert not false_cells(percent, np.zeros(percent.shape, dtype=bool)).any()


def test_the_first_tracer_at_a_well_is_seen(quiet):
    recording = open_recording(quiet)
    wells = cells_near(recording.rig.wells.values(), recording.grid)
    frame = np.zeros(recording.grid.shape)
    row, column = np.argwhere(wells)[0]
    frame[row, column] = 1.0
    assert not false_cells(frame, wells).any()


@given(
    st.floats(0.0, 30.0), st.floats(0.0, 60.0), st.floats(1.5, 30.0), st.floats(0.0, 0.05),
    st.integers(0, 1000),
)  # fmt: skip
def test_plumes_with_sharp_fronts_and_noise_have_no_false_cells(z, x, radius, noise, seed):
    rows, columns = np.ogrid[: SHAPE[0], : SHAPE[1]]
    plume = (np.hypot(rows - z, columns - x) < radius).astype(float)
    frame = plume + np.random.default_rng(seed).normal(0.0, noise, SHAPE)
    assert false_cells(frame, NO_WELLS).sum() <= 1
