"""Which physics a model lacks: parts are added while free runs on kept experiments gain by them.

Every round tries each kind of part on top of those chosen before, refits all of them together on
the experiments to learn from, and takes the best one. It stays if the error of the kept experiments
falls as well. So a part that only imitates noise is left out.

The runs are those of a precise scheme, whichever scheme is corrected. The error of a coarse scheme
is as large as that of a leak, and moves the leak to another place.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.fitted_effect import Candidate
from porotwin_core.model.held_out_share import HELD_OUT_SHARE
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver
from porotwin_costa.data.frames import Frames, cut, resampled, sequences
from porotwin_costa.physics.learnable import Learnable, physics_of, with_part
from porotwin_costa.physics.physics_fit import Comparison, fit

LEARNING_COLUMNS = 64
"""Most columns of the grid for the last fit, and for the errors that end the search. The model
refines it itself, so that its scheme hardly errs; more columns only cost time."""

SEARCH_COLUMNS = 40
"""Most columns of the grid for choosing parts: a run takes about a fifth of the time."""

LEAST_GAIN = 0.1
"""Share of the squared error that a part must take away where it is fitted; less is not worth a
part, and may be the numerics."""

CLEAR_GAIN = 0.7
"""Share of the squared error that makes a part so clear that no leak or patch is tried."""

UNKNOWN_COST = 0.1
"""Share of the squared error that another unknown must take, to be preferred: a patch can imitate
a denser tracer for a while."""

MOST_PARTS = 3
"""Most parts that are added."""

ENOUGH = 0.85
"""Share of the squared error of fitted and kept runs that all parts together take; then the search
ends."""

GOOD_ERROR = 0.04
"""Relative error of free runs [-] at which the search ends. The noise of photographs makes 0.02 to
0.03 and the rest of the scheme's error 0.02; the fluxes correct what remains."""

ITERATIONS = 6
"""Iterations of a fit; three are enough unless a place has to move."""

CHOICE_GAIN = 0.02
"""Share of the squared error that an iteration must take, to be followed by another one, in fits
that only choose between parts; parts that are chosen differ by more."""

TRIED_PLACES = 2
"""Most places of a leak, and of a patch, that are fitted: the most promising ones of all."""

MOST_FITTED = 1
"""Most runs for choosing parts: the ones with the largest errors. The last fit is to all runs."""

LAST_ITERATIONS = 3
"""Iterations of the last fit, to all frames."""

SolverOn = Callable[[Grid], LearntSolver]
"""Returns a solver on a grid of the rig."""

SayFn = Callable[[str], None]
"""Tells a person a line about the progress."""


class Solvers(NamedTuple):
    """Makers of solvers: with a `precise` scheme to fit physics, with a `quick` one to try places.

    A change of the physics changes the maps of both nearly alike.
    """

    precise: SolverOn
    quick: SolverOn


class Learnt(NamedTuple):
    """The parts that were chosen, and the scaled values of all their unknowns."""

    parts: tuple[Candidate, ...]
    values: FloatArray

    @property
    def physics(self) -> LearntPhysics:
        """The physics of all parts."""
        return physics_of(self.parts, self.values)


class PhysicsTrial(NamedTuple):
    """Parts that were fitted, with the squared errors where they were fitted and kept."""

    learnt: Learnt
    fitted: float
    kept: float


@dataclass(frozen=True)
class Share:
    """Frames to compare with: those to learn from, and those kept to judge.

    `quick` are the fitted ones with a quick solver.
    """

    fitted: Sequence[Comparison]
    kept: Sequence[Comparison]
    quick: Sequence[Comparison]

    @classmethod
    def of(cls, experiments: Sequence[Frames], grid: Grid, solvers: Solvers) -> 'Share':
        """Keep the last experiment, or the end of a single one.

        Raises:
            InputError: there are too few frames.
        """
        solver, quick = solvers.precise(grid), solvers.quick(grid)
        runs = _runs(experiments, grid)
        if len(runs) > 1:
            kept, fitted = [Comparison(runs[-1], grid, solver)], runs[:-1]
        else:
            whole = runs[0]
            end = float(whole.times[0] + (1 - HELD_OUT_SHARE) * (whole.times[-1] - whole.times[0]))
            kept = [Comparison(whole, grid, solver, after=end)]
            fitted = [cut(whole, end)]
        plain = LearntPhysics()
        shown = sorted(fitted, key=lambda run: -Comparison(run, grid, solver).cost(plain))
        chosen = shown[:MOST_FITTED]
        return cls(
            [Comparison(run, grid, solver) for run in chosen],
            kept,
            [Comparison(run, grid, quick) for run in chosen],
        )

    @property
    def power(self) -> tuple[float, float]:
        """The sums of squares of the fitted and of the kept maps, in the units of `cost`."""
        return sum(one.power for one in self.fitted), sum(one.power for one in self.kept)

    def cost(self, physics: LearntPhysics) -> tuple[float, float]:
        """Return the sums of squares of the fitted and of the kept comparisons."""
        return (
            sum(one.cost(physics) for one in self.fitted),
            sum(one.cost(physics) for one in self.kept),
        )


def learn_physics(
    grid: Grid,
    experiments: Sequence[Frames],
    solvers: Solvers,
    *,
    pool: Crew,
    say: SayFn = lambda _: None,
) -> LearntPhysics:
    """Return the physics that free runs from the start of each experiment need to follow it.

    Args:
        grid: the grid of all maps; physics is learnt on at most LEARNING_COLUMNS columns.
        experiments: the maps to learn from; a fourth at least is kept to judge.
        solvers: make solvers on a grid, which run the model with any physics.
        pool: its workers make the free runs.
        say: told every decision.

    Raises:
        InputError: there are too few frames, or the model cannot run.
    """
    share = Share.of(experiments, no_finer(grid, SEARCH_COLUMNS), solvers)
    finer = no_finer(grid, LEARNING_COLUMNS)
    judging = Share.of(experiments, finer, solvers)
    learnable = Learnable.of(solvers.precise(finer), finer, experiments)
    best = PhysicsTrial(Learnt((), np.zeros(0)), *share.cost(LearntPhysics()))
    search = PartSearch(learnable, share, judging, pool, judging.cost(LearntPhysics()))
    for _ in range(MOST_PARTS):
        if search.ends_with(best):
            break
        found = search.with_one_more(best.learnt)
        name = found.learnt.parts[-1].effect
        gain, kept_gain = _gain(best.fitted, found.fitted), _gain(best.kept, found.kept)
        if gain < LEAST_GAIN or kept_gain < LEAST_GAIN:
            say(f'no more physics to learn: {name} takes {percent(max(kept_gain, 0.0))} of the gap')
            break
        say(f'learnt {name}: takes {percent(kept_gain)} of the squared gap left on kept maps')
        best = found
    if not best.learnt.parts:
        say('the model lacks no physics that these maps show')
        return LearntPhysics()
    parts, start = best.learnt
    solver = solvers.precise(finer)
    whole = [Comparison(run, finer, solver) for run in _runs(experiments, finer)]
    values = fit(parts, whole, start, iterations=LAST_ITERATIONS, pool=pool)
    return physics_of(parts, values)


def _runs(experiments: Sequence[Frames], grid: Grid) -> list[Frames]:
    """Return the sequences of all maps on `grid` that are long enough for a free run.

    Raises:
        InputError: there is none.
    """
    maps = [resampled(frames, grid) for frames in experiments]
    runs = [run for frames in maps for run in sequences(frames) if len(run.times) > 2]
    if not runs:
        raise InputError('no free run can be compared: give three consecutive maps at least')
    return runs


def _judged(trial: PhysicsTrial) -> float:
    """Return the squared error, more for parts with more unknowns."""
    return (trial.fitted + trial.kept) * (1.0 + UNKNOWN_COST * len(trial.learnt.values))


def _gain(before: float, after: float) -> float:
    """Return the share of the squared error that is gone [-]."""
    return 1.0 - after / before if before > 0.0 else 0.0


def no_finer(grid: Grid, columns: int) -> Grid:
    """Return `grid`, or a coarser one with at most `columns` columns and rows."""
    shrink = math.ceil(max(grid.nx, grid.nz) / columns)  # halves of cells would smear the maps
    cells = round(grid.nx / shrink), round(grid.nz / shrink)
    return Grid(*cells, grid.width, grid.height)


def _errors_together(runs: Sequence[Comparison], physics: LearntPhysics) -> FloatArray:
    """Return the errors of all `runs` with `physics`, flat."""
    return np.concatenate([one.errors(physics) for one in runs])


@dataclass(frozen=True)
class PartSearch:
    """Looks for one more part that brings free runs closer to the frames of `share`.

    `judging` holds the same frames on a finer grid, and `alone` the costs there without any part.
    """

    learnable: Learnable
    share: Share
    judging: Share
    pool: Crew
    alone: tuple[float, float]

    def ends_with(self, trial: PhysicsTrial) -> bool:
        """Return whether the error that `trial` leaves on the finer grid is not worth another part.

        On the coarse one the scheme itself errs: another part would imitate that.
        """
        if not np.isfinite(trial.fitted):
            return False
        left = self.judging.cost(trial.learnt.physics)
        shares = [cost / power for cost, power in zip(left, self.judging.power, strict=True)]
        gains = [_gain(before, after) for before, after in zip(self.alone, left, strict=True)]
        return max(shares) < GOOD_ERROR**2 or min(gains) > ENOUGH

    def _is_good(self, trial: PhysicsTrial) -> bool:
        """Return whether the error on the grid of the search is too small to fit places to it."""
        errors = zip((trial.fitted, trial.kept), self.share.power, strict=True)
        return max(cost / power for cost, power in errors) < GOOD_ERROR**2

    def with_one_more(self, known: Learnt) -> PhysicsTrial:
        """Return the best trial of `known` with one more part, refitted.

        Leaks and patches are tried only if no part without a place explains nearly everything or
        leaves a good error, the most promising one first, until one of them ends the search.
        """
        taken = {part.effect for part in known.parts}
        parts = [part for part in self.learnable.everywhere() if part.effect not in taken]
        trials = [self._fitted(part, known) for part in parts]
        before, _ = self.share.cost(known.physics)
        clear = any(_gain(before, trial.fitted) >= CLEAR_GAIN for trial in trials)
        best = min(trials, key=_judged)
        if not (clear or self._is_good(best) or self.ends_with(best)):
            for part in self._placed(known):
                trials.append(self._fitted(part, known))
                if self.ends_with(trials[-1]):
                    break
        return min(trials, key=_judged)

    def _fitted(self, part: Candidate, known: Learnt) -> PhysicsTrial:
        """Return `known` with one more part, all of them fitted together."""
        parts, start = (*known.parts, part), np.concatenate([known.values, part.first])
        values = fit(
            parts,
            self.share.fitted,
            start,
            iterations=ITERATIONS,
            pool=self.pool,
            least_gain=CHOICE_GAIN,
        )
        learnt = Learnt(parts, values)
        try:
            return PhysicsTrial(learnt, *self.share.cost(learnt.physics))
        except InputError:  # a model that cannot have this part
            return PhysicsTrial(learnt, np.inf, np.inf)

    def _placed(self, known: Learnt) -> list[Candidate]:
        """Return the effects at the places where they promise most, the best one first.

        A part that changes the errors r by J explains (J r)^2 / J^2 of the sum of their squares. J
        is taken without what would make every run three times as slow. Both signs are run: a dense
        patch and a permeable one lead the flow around different ways.
        """
        physics = known.physics
        light = self.learnable.solver.light(physics)
        errors, runs = _errors_together(self.share.fitted, physics), self.share.quick
        base = _errors_together(runs, light)
        parts = [part for place in self.learnable.places() for part in self.learnable.at(place)]
        moved = [with_part(light, part, part.first) for part in parts]
        changed = self.pool.map(_errors_together, repeat(self.pool.share(runs)), moved)
        explained = []
        for there in changed:
            change = there - base
            along = max(-float(change @ errors), 0.0)
            explained.append(along**2 / (float(change @ change) + 1.0))
        chosen: list[Candidate] = []
        for part in (parts[n] for n in np.argsort(explained)[::-1]):
            if sum(one.effect == part.effect for one in chosen) < TRIED_PLACES:
                chosen.append(part)
        return chosen
