"""Frames of a recording: selects frames and fills unseen cells."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.geometry.map_blocks import LEAST_SEEN
from porotwin_recording.experiment.recording import Recording

HOLE_FILL_WIDTH = 3.0
"""Width [cells] of the Gaussian mean that fills unseen cells from their neighbours."""


LEAST_INTERVAL = 0.5
"""Least time between two frames, as a share of the median interval. Photographs in quick succession
differ by their noise only."""


def filled_map(frame: FloatArray, grid: Grid) -> FloatArray:
    """Return `frame` (nz, nx) [-] on `grid`, within 0..1, with unseen cells filled.

    An unseen cell (NaN) takes the Gaussian mean of the seen cells around it.
    """
    known = np.isfinite(frame)
    if not known.all():
        weight = gaussian_filter(known.astype(float), HOLE_FILL_WIDTH)
        mean = gaussian_filter(np.where(known, frame, 0.0), HOLE_FILL_WIDTH)
        frame = np.where(known, frame, mean / np.maximum(weight, 1e-6))
    return np.clip(conservative_resample(frame.astype(float), grid.shape), 0.0, 1.0)


def evenly_spread(indices: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return at most `count` of `indices` (n,), evenly spread, the first and the last included."""
    if len(indices) <= count:
        return indices
    return indices[np.round(np.linspace(0, len(indices) - 1, count)).astype(int)]


def observed_maps(
    recording: Recording, grid: Grid, count: int
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    """Return at most `count` frames of `recording` on `grid`, evenly spread in time.

    Frames with less than half of their cells seen are left out, because the filled map would be
    mostly guessed.

    Returns:
        Times [s] (nt,); maps (nz, nx) [-] without NaN; the seen share (nz, nx) [-] of every cell.

    Raises:
        InputError: the recording holds no maps, or fewer than two with enough seen cells.
    """
    stored = recording.maps if len(recording.times) else None
    assert stored is not None  # `times` says so otherwise
    seen = [index for index, frame in enumerate(stored) if np.isfinite(frame).mean() >= LEAST_SEEN]
    if len(seen) < 2:
        raise InputError(
            f'{recording.source}: fewer than two maps show at least {percent(LEAST_SEEN)} of the '
            'rig; record with a free view'
        )
    seen = _without_bursts(seen, recording.times)
    frames = np.unique(np.array(seen)[np.linspace(0, len(seen) - 1, count).round().astype(int)])
    observed = [stored[int(frame)] for frame in frames]
    maps = [filled_map(frame, grid) for frame in observed]
    shares = [conservative_resample(np.isfinite(f).astype(float), grid.shape) for f in observed]
    return recording.times[frames], maps, shares


def _without_bursts(frames: list[int], times: FloatArray) -> list[int]:
    """Return `frames` without those that follow another one too soon to show a difference."""
    least = LEAST_INTERVAL * float(np.median(np.diff(times[frames])))
    kept = frames[:1]
    for frame in frames[1:]:
        if times[frame] - times[kept[-1]] >= least:
            kept.append(frame)
    return kept
