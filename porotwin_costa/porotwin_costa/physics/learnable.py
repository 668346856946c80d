"""The effects that may be learnt from some experiments."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.fitted_effect import Candidate
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver, Place
from porotwin_costa.data.frames import Frames

PLACE_SPACING = 0.065
"""Distance of the places that are tried, relative to the longer side of the rig."""


def physics_of(parts: Sequence[Candidate], scaled: FloatArray) -> LearntPhysics:
    """Return the physics of all `parts` at the steps of their parameters, in one array."""
    steps = iter(map(float, scaled))
    effects = (one.described([next(steps) for _ in one.parameters]) for one in parts)
    return LearntPhysics(tuple(effects))


def with_part(physics: LearntPhysics, part: Candidate, scaled: Iterable[float]) -> LearntPhysics:
    """Return `physics` with one more part at the steps of its parameters."""
    return LearntPhysics((*physics.effects, part.described(list(scaled))), physics.scheme)


@dataclass(frozen=True)
class Learnable:
    """The effects that a `solver` can learn on a `grid`.

    `duration` [s] is the length of the longest experiment, `strongest` [m^3/s] the largest rate.
    """

    solver: LearntSolver
    grid: Grid
    duration: float
    strongest: float

    @classmethod
    def of(cls, solver: LearntSolver, grid: Grid, experiments: Sequence[Frames]) -> 'Learnable':
        """Return those of `experiments`."""
        rates = (abs(row.rate.rate) for each in experiments for row in each.schedule.rows)
        duration = max(float(frames.times[-1] - frames.times[0]) for frames in experiments)
        return cls(solver, grid, duration, max(rates, default=0.0))

    @property
    def size(self) -> float:
        """The longer side of the rig [m]."""
        return max(self.grid.width, self.grid.height)

    def everywhere(self) -> Sequence[Candidate]:
        """Return the effects without a place."""
        return self.solver.learnable(self.duration, self.strongest)

    def at(self, place: Place) -> Sequence[Candidate]:
        """Return the trials of effects at `place`, one of each sign."""
        return self.solver.learnable(self.duration, self.strongest, place)

    def places(self) -> Iterator[Place]:
        """Yield the places where effects are tried."""
        spacing = PLACE_SPACING * self.size
        columns = max(1, round(self.grid.width / spacing))
        rows = max(1, round(self.grid.height / spacing))
        for j, i in np.ndindex(rows, columns):
            yield (i + 0.5) * self.grid.width / columns, (j + 0.5) * self.grid.height / rows
