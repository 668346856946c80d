"""The map of the gap: where and when the model departs from a recording.

The model makes one short step from every observed map. In this short time the flow cannot carry a
gap elsewhere. The residual of the step is integrated against Gaussians of a few cells (a weak
form), so grain, point spread and numerical smearing cancel:

    g = G(observed - predicted) / dt,   strength^2 = mean over the steps of (g^2 - noise of g^2).

The map shows places and times only. Its sizes are not used, because noise of the starting map
biases them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rates.wells import Schedule, WellRates
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.error_parts import COARSER
from porotwin_diagnosis.data.noise_estimation import measure_noise
from porotwin_diagnosis.data.observed_maps import observed_maps
from porotwin_diagnosis.data.sample import FEWEST_CELLS
from porotwin_recording.experiment.recording import Recording
from porotwin_solver.model.model import Model

TEST_FUNCTION_WIDTH = 2.0
"""Width [cells of the gap map] of the test functions."""

MOST_STEPS = 30
"""Largest number of steps; it bounds the time."""

MOST_HOT_SPOTS = 4
"""Largest number of hot spots; more would distract from the strongest."""

HOT_SPOT_RADIUS = 0.06
"""Radius of a hot spot as a share of the rig's longer side: two to three widths of the test
functions on a grid of 187 columns."""

LEAST_SPOT_SHARE = 0.05
"""Share of the gap below which a hot spot is not reported; it would distract from stronger ones."""


@dataclass(frozen=True)
class Spot:
    """A hot spot at (`x`, `z`) [m] with a `radius` [m], and its `share` [-] of the gap."""

    x: float
    z: float
    radius: float
    share: float


@dataclass(frozen=True)
class Phase:
    """An interval of one operating state of the wells, and its share of the gap.

    Attributes:
        start: beginning [s].
        end: end [s].
        share: share of the gap [-].
        state: `injecting` tracer, `chasing` it (they pump, but no tracer), or `resting`.
        recording: index of the recording.
    """

    start: float
    end: float
    share: float
    state: str
    recording: int


@dataclass(frozen=True)
class GapMap:
    """Where and when the gap of one or several recordings arises.

    Attributes:
        strength: strength of the gap (nz, nx) [1/s] on the grid of the first recording, as a root
            mean square over the recordings.
        each: strength (nz, nx) [1/s] of every recording on its own grid.
        spots: hot spots, the strongest first.
        phases: operating states, the one with the largest share first.
    """

    strength: FloatArray
    each: tuple[FloatArray, ...]
    spots: tuple[Spot, ...]
    phases: tuple[Phase, ...]

    def without_places(self) -> 'GapMap':
        """Return the map without hot spots and phases, for recordings without a gap."""
        return replace(self, spots=(), phases=())


class StepEnergy(NamedTuple):
    """One step of the model from `start` to `end` [s], and the energy of its residual [m^2/s]."""

    start: float
    end: float
    energy: float


def map_gap(
    *recordings: Recording, preset: str = 'fast', effects: Sequence[EffectDescription] = ()
) -> GapMap:
    """Return where and when the model of the rig departs from `recordings` of one rig.

    Args:
        recordings: at least one recording with maps and rates.
        preset: preset of the solver.
        effects: effects of the model beyond those of the rig description.

    Raises:
        InputError: a recording holds no maps, or fewer than two with enough seen cells.
    """
    parts = [_one_step_residuals(recording, preset, effects) for recording in recordings]
    grid = parts[0][0]
    squares = [conservative_resample(strength, grid.shape) ** 2 for _, strength, _ in parts]
    strength = np.sqrt(np.mean(squares, axis=0))
    return GapMap(
        strength=_on_grid(strength, recordings[0].grid),
        each=tuple(
            _on_grid(own, recording.grid)
            for recording, (_, own, _) in zip(recordings, parts, strict=True)
        ),
        spots=_hot_spots(strength, grid),
        phases=operating_phases([steps for *_, steps in parts], [r.delivered for r in recordings]),
    )


def _one_step_residuals(
    recording: Recording, preset: str, effects: Sequence[EffectDescription]
) -> tuple[Grid, FloatArray, list[StepEnergy]]:
    """Return a coarse grid, the strength of the gap (nz, nx) [1/s] on it, and all steps."""
    grid = recording.grid
    coarse = recording.rig.grid(
        max(FEWEST_CELLS, grid.nx // COARSER), max(FEWEST_CELLS, grid.nz // COARSER)
    )
    model = Model(recording.rig, coarse, preset=preset, effects=effects)
    times, maps, seen = observed_maps(recording, coarse, MOST_STEPS + 1)
    noise = measure_noise(np.stack(maps))
    energy = np.zeros(coarse.shape)
    steps: list[StepEnergy] = []
    cell = coarse.dx * coarse.dz
    pairs = zip(pairwise(maps), pairwise(seen), pairwise(times), strict=True)
    for (before, after), (seen_before, seen_after), (start, end) in pairs:
        predicted = before
        for low, high, rates in recording.delivered.intervals(start, end):
            predicted = model.at(low).predict(predicted, rates, high - low)
        residual = (after - predicted) * seen_before * seen_after
        weak = gaussian_filter(residual, TEST_FUNCTION_WIDTH) / (end - start)
        # white noise of two frames, damped by a Gaussian of width w by the factor 1 / (4 pi w^2)
        damping = 4.0 * np.pi * TEST_FUNCTION_WIDTH**2
        noise_square = 2.0 * noise.frame_deviation(predicted) ** 2 / damping
        excess = weak**2 - noise_square / (end - start) ** 2
        energy += excess
        total = max(0.0, float(np.sum(excess) * cell * (end - start)))
        steps.append(StepEnergy(start, end, total))
    strength = np.sqrt(np.maximum(energy, 0.0) / max(len(steps), 1))
    background = float(np.median(strength))
    return coarse, np.maximum(strength - background, 0.0), steps


def _on_grid(strength: FloatArray, grid: Grid) -> FloatArray:
    fine = np.kron(strength, np.ones((COARSER, COARSER)))
    return fine if fine.shape == grid.shape else conservative_resample(strength, grid.shape)


def _hot_spots(strength: FloatArray, grid: Grid) -> tuple[Spot, ...]:
    """Return the strongest spots of `strength` (nz, nx), each found with the others removed."""
    energy = strength**2
    total = float(energy.sum())
    radius = HOT_SPOT_RADIUS * max(grid.width, grid.height)
    spots: list[Spot] = []
    while total > 0 and len(spots) < MOST_HOT_SPOTS:
        smooth = gaussian_filter(energy, 0.5 * radius / grid.dx)
        row, column = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
        x, z = float(grid.x[column]), float(grid.z[row])
        inside = np.hypot(grid.x[None, :] - x, grid.z[:, None] - z) <= radius
        share = float(energy[inside].sum()) / total
        if share < LEAST_SPOT_SHARE:
            break
        spots.append(Spot(x, z, radius, share))
        energy = np.where(inside, 0.0, energy)
    return tuple(spots)


def operating_phases(
    steps: Sequence[Sequence[StepEnergy]], schedules: Sequence[Schedule]
) -> tuple[Phase, ...]:
    """Return the intervals of one operating state and their shares of the gap, largest first.

    Args:
        steps: steps of every recording in the order of their times.
        schedules: rates of the wells of every recording.
    """
    total = sum(energy for own in steps for _, _, energy in own) or 1.0
    phases = []
    for number, (own, schedule) in enumerate(zip(steps, schedules, strict=True)):
        intervals = schedule.intervals(own[0].start, own[-1].end)
        for state, group in groupby(intervals, key=lambda interval: _state(interval[2])):
            together = list(group)
            low, high = together[0][0], together[-1][1]
            share = sum(
                energy * max(0.0, min(high, end) - max(low, start)) / (end - start)
                for start, end, energy in own
            )
            phases.append(Phase(low, high, share / total, state, number))
    return tuple(sorted(phases, key=lambda phase: -phase.share))


def _state(rates: WellRates) -> str:
    """Return the operating state of the wells at these rates."""
    if any(rate.rate > 0 and rate.concentration > 0 for rate in rates.values()):
        return 'injecting'
    return 'chasing' if any(rate.rate for rate in rates.values()) else 'resting'
