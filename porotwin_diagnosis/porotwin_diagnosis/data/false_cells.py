"""Recordings without the single cells of their maps that no tracer explains."""

from dataclasses import replace

import numpy as np

from porotwin_checks.checks.lone_cells import false_cells
from porotwin_checks.near_wells import cells_near
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import Maps


def without_false_cells(recording: Recording) -> Recording:
    """Return `recording` with NaN in the false cells of its maps; its files stay as they are.

    Raises:
        InputError: the recording holds no maps.
    """
    maps = recording.present_maps
    wells = cells_near(recording.rig.wells.values(), maps.grid)

    def read(start: int, stop: int) -> Maps:
        shown = np.array(maps.read(start, stop))
        for frame in shown:
            frame[false_cells(frame, wells)] = np.nan
        return shown

    return replace(recording, maps=replace(maps, read=read))
