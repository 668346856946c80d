"""Where and when the gap arises: what one short step of the model does wrong, by place and time.

Started afresh from every observed map, the model has no time to carry a gap elsewhere. The
residual of the step is integrated against broad test functions (a Gaussian of a few cells: the weak
form), so that grain, blur and the step's own smearing of fronts cancel. It shows places and times;
sizes are never concluded from it, for noise in the starting map makes them wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from scipy.ndimage import gaussian_filter

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.wells import Schedule, WellRates
from porotwin_diagnosis.data.noise import measure_noise
from porotwin_diagnosis.data.sample import filled_map
from porotwin_recording.recording import Recording
from porotwin_solver.model import Model

TEST_WIDTH = 2.0
"""Width [cells of the coarse grid] of the test functions."""

COARSENING = 2
STEPS = 30
"""Pairs of frames looked at."""

LEAST_SEEN = 0.5
"""Share of a frame's cells that must be seen."""

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
    """A time [s] in which the pumps did one thing, and its share of the gap.

    `state`: `injecting` tracer, `chasing` it with water, or `resting`. `recording` is the number of
    the recording that it is a part of.
    """

    start: float
    end: float
    share: float
    state: str
    recording: int = 0


@dataclass(frozen=True)
class GapMap:
    """Where and when the gap of one or several recordings arises.

    `strength` (nz, nx) [1/s] on the first recording's grid, of several the root mean square; `each`
    that of every recording on its own grid. Hot spots and phases, the strongest first.
    """

    strength: FloatArray
    each: tuple[FloatArray, ...]
    spots: tuple[Spot, ...]
    phases: tuple[Phase, ...]

    def without_places(self) -> 'GapMap':
        """Return the map alone: where there is no gap, no place or time holds a share of it."""
        return replace(self, spots=(), phases=())


def map_gap(*recordings: Recording, preset: str = 'fast') -> GapMap:
    """Return where and when the model of the rig at `preset` departs from `recordings`, which are
    of one rig.

    Raises:
        InputError: a recording holds no maps, or fewer than two of which enough is seen.
    """
    steps = [_one_steps(recording, preset) for recording in recordings]
    grid = steps[0][0]
    squares = [conservative_resample(strength, grid.shape) ** 2 for _, strength, _ in steps]
    together = np.sqrt(np.mean(squares, axis=0))
    return GapMap(
        _on_grid(together, recordings[0].grid),
        tuple(
            _on_grid(strength, recording.grid)
            for recording, (_, strength, _) in zip(recordings, steps, strict=True)
        ),
        _spots(together, grid),
        _phases([moments for *_, moments in steps], [r.delivered for r in recordings]),
    )


def _one_steps(
    recording: Recording, preset: str
) -> tuple[Grid, FloatArray, list[tuple[float, float, float]]]:
    """Return a coarse grid, the gap strength on it, and (start, end, energy) of every step."""
    grid = recording.grid
    coarse = recording.rig.grid(max(4, grid.nx // COARSENING), max(4, grid.nz // COARSENING))
    model = Model(recording.rig, coarse, preset=preset)
    times, maps, seen = observed_maps(recording, coarse, STEPS + 1)
    noise = measure_noise(np.stack(maps))
    energy = np.zeros(coarse.shape)
    moments: list[tuple[float, float, float]] = []
    cell = coarse.dx * coarse.dz
    steps = zip(pairwise(maps), pairwise(seen), pairwise(times), strict=True)
    for (before, after), (known, still_known), (start, end) in steps:
        predicted = before
        for low, high, rates in recording.delivered.intervals(start, end):
            predicted = model.predict(predicted, rates, high - low)
        residual = (after - predicted) * known * still_known
        weak = gaussian_filter(residual, TEST_WIDTH) / (end - start)
        # new in both frames, and damped by a Gaussian as white noise is
        unsure = 2.0 * noise.frame_deviation(predicted) ** 2 / (4.0 * np.pi * TEST_WIDTH**2)
        left = weak**2 - unsure / (end - start) ** 2
        energy += left
        moments.append((start, end, max(0.0, float(np.sum(left) * cell * (end - start)))))
    strength = np.sqrt(np.maximum(energy, 0.0) / max(len(moments), 1))
    floor = float(np.median(strength))
    return coarse, np.maximum(strength - floor, 0.0), moments


def _on_grid(strength: FloatArray, grid: Grid) -> FloatArray:
    fine = np.kron(strength, np.ones((COARSENING, COARSENING)))
    return fine if fine.shape == grid.shape else conservative_resample(strength, grid.shape)


def observed_maps(
    recording: Recording, grid: Grid, count: int
) -> tuple[FloatArray, list[FloatArray], list[FloatArray]]:
    """Return at most `count` times and observed maps, evenly spread, without NaN, on `grid`, and
    the share of each cell that is seen.

    Frames of which little is seen are left out: filled, they would look like another state.
    """
    seen = [
        index
        for index, frame in enumerate(recording.concentration)
        if np.isfinite(frame).mean() > LEAST_SEEN
    ]
    if len(seen) < 2:
        raise InputError(f'{recording.source}: most maps are empty; two are needed with half seen')
    seen = _apart(seen, recording.times)
    frames = np.unique(np.array(seen)[np.linspace(0, len(seen) - 1, count).round().astype(int)])
    observed = [recording.concentration[frame] for frame in frames]
    maps = [filled_map(frame, grid) for frame in observed]
    known = [conservative_resample(np.isfinite(f).astype(float), grid.shape) for f in observed]
    return recording.times[frames], maps, known


def _apart(frames: list[int], times: FloatArray) -> list[int]:
    """Return `frames` without those that follow another too soon to show more than noise."""
    least = 0.5 * float(np.median(np.diff(times[frames])))
    kept = frames[:1]
    for frame in frames[1:]:
        if times[frame] - times[kept[-1]] >= least:
            kept.append(frame)
    return kept


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


def _phases(
    moments: Sequence[list[tuple[float, float, float]]], schedules: Sequence[Schedule]
) -> tuple[Phase, ...]:
    """Return the gap's share of every stretch of one operating state, the strongest first."""
    total = sum(energy for own in moments for _, _, energy in own) or 1.0
    phases = []
    for number, (own, schedule) in enumerate(zip(moments, schedules, strict=True)):
        stretches = schedule.intervals(own[0][0], own[-1][1])
        for state, group in groupby(stretches, key=lambda stretch: _state(stretch[2])):
            together = list(group)
            low, high = together[0][0], together[-1][1]
            share = sum(
                energy * max(0.0, min(high, until) - max(low, since)) / (until - since)
                for since, until, energy in own
            )
            phases.append(Phase(low, high, share / total, state, number))
    return tuple(sorted(phases, key=lambda phase: -phase.share))


def _state(rates: WellRates) -> str:
    if any(rate.rate > 0 and rate.concentration > 0 for rate in rates.values()):
        return 'injecting'
    return 'chasing' if any(rate.rate for rate in rates.values()) else 'resting'
