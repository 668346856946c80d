"""Maps of phases on disk: a NetCDF file with a number for each phase, by the CF conventions."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import Grid
from porotwin_recording.tables.map_writer import MapWriter

NO_PHASE = 255
"""Fill value: cells without a phase."""


class PhaseMapWriter(MapWriter):
    """Writes maps of phases one by one; the file gets its name when it is complete.

    Args:
        path: the file.
        grid: the grid of the maps.
        phases: names of the phases; their numbers are the indices.
        reasons: names of the reasons why a cell has no phase; the first one is that it has one.
        program: name and version of the program.
        colours: the colours of the phases in words.

    Raises:
        InputError: the file cannot be created.
        OSError: the disk is full, when the file is made, or in `append` and at the end.
    """

    def __init__(
        self,
        path: Path,
        grid: Grid,
        phases: Sequence[str],
        reasons: Sequence[str],
        *,
        program: str = '',
        colours: Sequence[str] = (),
    ) -> None:
        super().__init__(path, grid)
        self._dataset.setncatts(
            {'Conventions': 'CF-1.11', 'program': program, 'colours': '; '.join(colours)}
        )
        self._define(
            'phase',
            'u1',
            NO_PHASE,
            {
                'long_name': 'phase in the pores',
                'flag_values': np.arange(len(phases), dtype=np.uint8),
                'flag_meanings': ' '.join(phases),
            },
        )
        self._define(
            'confidence',
            'f4',
            np.float32(np.nan),
            {'units': '1', 'long_name': 'probability of the phase'},
        )
        self._define(
            'reason',
            'u1',
            NO_PHASE,
            {
                'long_name': 'why a cell has no phase',
                'flag_values': np.arange(len(reasons), dtype=np.uint8),
                'flag_meanings': ' '.join(reasons),
            },
        )

    def append(
        self, time: float, phase: NDArray[np.uint8], confidence: NDArray, reason: NDArray[np.uint8]
    ) -> None:
        """Write phases (nz, nx), their probability [-], and reasons of no phase at `time` [s].

        Raises:
            InputError: a shape is not the one of the grid, or `time` does not increase.
            OSError: the disk is full or fails.
        """
        self._check(time, (phase, confidence, reason))
        self._write(time, {'phase': phase, 'confidence': confidence, 'reason': reason})
