"""The physics that lets free runs follow the recordings: least squares through whole roll-outs.

A free run starts at the first map of a sequence and never sees another one. So the noise of single
maps does not bias the result, and an error that grows slowly counts as much as a fast one. Slopes
are finite differences of free runs.
"""

from collections.abc import Sequence
from itertools import repeat

import numpy as np

from porotwin_core.basis.parallel import Crew
from porotwin_core.geometry.grid import FloatArray, Grid, fill_unseen
from porotwin_core.geometry.map_blocks import Blocks
from porotwin_core.model.fitted_effect import Candidate
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver
from porotwin_core.model.levenberg_marquardt import LEAST_GAIN, Bounds, minimise
from porotwin_costa.data.frames import Frames
from porotwin_costa.physics.learnable import physics_of

COMPARED_CELL_M = 0.010
"""Maps are compared on cells at least so wide [m]: finer cells tell no more about the physics."""

COMPARED_FRAMES = 12
"""Frames of every sequence that are compared; neighbouring frames tell nearly the same."""

TYPICAL_ERROR = 0.1
"""Error of a compared cell [-] that weighs as much as one standard deviation of a prior. It is
larger than the noise, because the errors of neighbouring cells are alike."""


class Comparison:
    """One sequence of frames, and how far free runs lie from it."""

    def __init__(
        self, frames: Frames, grid: Grid, solver: LearntSolver, *, after: float = -np.inf
    ) -> None:
        """Compare COMPARED_FRAMES frames after `after` [s] and the first one, spread evenly."""
        last = len(frames.times) - 1
        first = min(max(0, int(np.searchsorted(frames.times, after)) - 1), last - 1)
        count = min(COMPARED_FRAMES, last - first)
        chosen = np.linspace(first, last, count + 1).round().astype(int)[1:]
        rows, columns = (max(1, round(COMPARED_CELL_M / size)) for size in (grid.dz, grid.dx))
        self._schedule, self._solver = frames.schedule, solver
        self._start = float(frames.times[0])
        self._initial = fill_unseen(frames.concentration[0].astype(float), None)
        self._blocks = Blocks(grid.shape, rows, columns)
        self._times = frames.times[chosen]
        observed = frames.concentration[chosen].astype(float)
        self._seen = np.isfinite(observed)
        self._observed = [self._means(values, n) for n, values in enumerate(observed)]

    @property
    def power(self) -> float:
        """The sum of squares of the observed maps over TYPICAL_ERROR; at least 1."""
        observed = np.concatenate(self._observed) / TYPICAL_ERROR
        return max(1.0, float(np.sum(np.square(observed))))

    def errors(self, physics: LearntPhysics) -> FloatArray:
        """Return model minus observed over TYPICAL_ERROR, flat.

        Raises:
            InputError: the model cannot run with `physics`.
        """
        maps = self._solver.run(
            physics, self._schedule, self._times, initial=self._initial, start=self._start
        )
        parts = [self._means(values, n) - self._observed[n] for n, values in enumerate(maps)]
        return (np.concatenate(parts) / TYPICAL_ERROR).astype(np.float32)

    def cost(self, physics: LearntPhysics) -> float:
        """Return the sum of squares of `errors`."""
        return float(np.sum(np.square(self.errors(physics), dtype=float)))

    def _means(self, values: FloatArray, number: int) -> FloatArray:
        return self._blocks.means(values, self._seen[number])


def fit(
    parts: Sequence[Candidate],
    comparisons: Sequence[Comparison],
    start: FloatArray,
    *,
    iterations: int,
    pool: Crew,
    least_gain: float = LEAST_GAIN,
) -> FloatArray:
    """Return the scaled values of all unknowns of `parts` with the least sum of squares.

    The iteration begins at `start`, and ends when it takes less than `least_gain` of the sum. The
    workers of `pool` make the free runs.
    """
    shared = [pool.share(one) for one in comparisons]
    parameters = [one for part in parts for one in part.parameters]
    lowest, highest = np.array([one.range for one in parameters]).T
    deviations = np.array([one.prior_deviation for one in parameters])

    def residuals(values: FloatArray) -> list[FloatArray]:
        physics = physics_of(parts, values)
        found = list(pool.map(Comparison.errors, shared, repeat(physics)))
        return [*found, values / deviations]

    def slopes(values: FloatArray, here: Sequence[FloatArray]) -> list[FloatArray]:
        steps = np.where(values < highest - 1.0, 1.0, -1.0)
        moved = [physics_of(parts, values + move) for move in np.diag(steps)]
        size = len(values)
        each = [one for one in shared for _ in range(size)]
        errors = list(pool.map(Comparison.errors, each, moved * len(shared)))
        stacks = [
            np.stack([(mine - errors[n * size + i]) / steps[i] for i in range(size)])
            for n, mine in enumerate(here[: len(shared)])
        ]
        return [*stacks, -np.eye(size) / deviations]

    bounds = Bounds(lowest, highest)
    return minimise(residuals, slopes, start, bounds, iterations=iterations, least_gain=least_gain)
