"""Where and when the gap arises: what one short step of the model does wrong, by place and time.

Started afresh from every observed map, the model has no time to carry a gap elsewhere. The
residual of the step is integrated against broad test functions (a Gaussian of a few cells: the weak
form), so that grain, blur and the step's own smearing of fronts cancel. It shows places and times;
sizes are never concluded from it, for noise in the starting map makes them wrong.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter

from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.wells import Schedule
from porotwin_recording.recording import Recording
from porotwin_solver.model import Model

TEST_WIDTH = 2.0
"""Width [cells of the coarse grid] of the test functions."""

COARSENING = 2
STEPS = 30
"""Pairs of frames looked at."""

SPOTS, SPOT_RADIUS, LEAST_SHARE = 4, 0.06, 0.05


@dataclass(frozen=True)
class Spot:
    """A place where the gap arises: `share` of the whole lies within `radius` [m]."""

    x: float
    z: float
    radius: float
    share: float


@dataclass(frozen=True)
class Phase:
    """A time [s] between two changes of the pumps, what they did, and its share of the gap."""

    start: float
    end: float
    share: float
    state: str


@dataclass(frozen=True)
class GapMap:
    """`strength` (nz, nx) [1/s] on the recording's grid; hot spots and phases, strongest first."""

    strength: FloatArray
    spots: tuple[Spot, ...]
    phases: tuple[Phase, ...]


def map_gap(recording: Recording) -> GapMap:
    """Return where and when the model of `recording.rig` departs from the recording."""
    grid = recording.grid
    coarse = recording.rig.grid(max(4, grid.nx // COARSENING), max(4, grid.nz // COARSENING))
    model = Model(recording.rig, coarse, setting='fast')
    times, maps = observed_maps(recording, coarse, STEPS + 1)
    energy = np.zeros(coarse.shape)
    moments: list[tuple[float, float, float]] = []
    for (before, after), (start, end) in zip(pairwise(maps), pairwise(times), strict=True):
        predicted = before
        for low, high, rates in recording.schedule.intervals(start, end):
            predicted = model.predict(predicted, rates, high - low)
        weak = gaussian_filter(after - predicted, TEST_WIDTH) / (end - start)
        energy += weak**2
        moments.append((start, end, float(np.sum(weak**2) * (end - start))))
    strength = np.sqrt(energy / max(len(moments), 1))
    floor = float(np.median(strength))
    strength = np.maximum(strength - floor, 0.0)
    fine = np.kron(strength, np.ones((COARSENING, COARSENING)))
    if fine.shape != grid.shape:
        fine = conservative_resample(strength, grid.shape)
    return GapMap(fine, _spots(strength, coarse), _phases(moments, recording.schedule))


def observed_maps(
    recording: Recording, grid: Grid, count: int
) -> tuple[FloatArray, list[FloatArray]]:
    """Return at most `count` times and observed maps, evenly spread, without NaN, on `grid`."""
    frames = np.linspace(0, len(recording.times) - 1, count).round().astype(int)
    frames = np.unique(frames)
    maps = [_filled(recording.concentration[frame], grid) for frame in frames]
    return recording.times[frames], maps


def _filled(frame: FloatArray, grid: Grid) -> FloatArray:
    known = np.isfinite(frame)
    if not known.all():
        weight = gaussian_filter(known.astype(float), 3.0)
        guess = gaussian_filter(np.where(known, frame, 0.0), 3.0) / np.maximum(weight, 1e-6)
        frame = np.where(known, frame, guess)
    return np.clip(conservative_resample(frame.astype(float), grid.shape), 0.0, 1.0)


def _spots(strength: FloatArray, grid: Grid) -> tuple[Spot, ...]:
    left = strength**2
    total = float(left.sum())
    radius = SPOT_RADIUS * max(grid.width, grid.height)
    spots: list[Spot] = []
    while total > 0 and len(spots) < SPOTS:
        near = gaussian_filter(left, 0.5 * radius / grid.dx)
        row, column = np.unravel_index(int(np.argmax(near)), near.shape)
        x, z = float(grid.x[column]), float(grid.z[row])
        inside = np.hypot(grid.x[None, :] - x, grid.z[:, None] - z) <= radius
        share = float(left[inside].sum()) / total
        if share < LEAST_SHARE:
            break
        spots.append(Spot(x, z, radius, share))
        left = np.where(inside, 0.0, left)
    return tuple(spots)


def _phases(moments: list[tuple[float, float, float]], schedule: Schedule) -> tuple[Phase, ...]:
    """Return the gap's share of every stretch of constant pumping, the strongest first."""
    total = sum(energy for _, _, energy in moments) or 1.0
    start, end = moments[0][0], moments[-1][1]
    phases = []
    for low, high, rates in schedule.intervals(start, end):
        share = sum(
            energy * max(0.0, min(high, until) - max(low, since)) / (until - since)
            for since, until, energy in moments
        )
        injecting = [rate for rate in rates.values() if rate.rate > 0]
        state = 'resting'
        if any(rate.rate for rate in rates.values()):
            state = 'chasing'
        if any(rate.concentration > 0 for rate in injecting):
            state = 'injecting'
        phases.append(Phase(low, high, share / total, state))
    return tuple(sorted(phases, key=lambda phase: -phase.share))
