"""Fits of effects to the first part of recordings, with free-running simulations.

Levenberg-Marquardt with finite differences in natural steps (Nocedal & Wright, Numerical
Optimization, sec. 10.3), coarse residuals first: fronts that lie cells apart have no gradient at
the resolution of the maps.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.candidates import IMAGE, Candidate, Knob
from porotwin_diagnosis.evidence import COARSE_WIDTH, WIDTH, misfit, noise_misfit
from porotwin_diagnosis.forward import Forward

TILE = 5
"""Compared cells per side of a tile whose residuals count as one observation."""


LEAST_GAIN = 5e-4
"""Relative fall of the sum of squares below which a fit is finished."""

CHEAP_STEPS = 8
"""How many times more steps a fit may take that needs no simulation."""

TRIALS = 6
"""Lengths of a step that are tried before a fit gives up, the last a hundredth of the first; with
foreign slopes only one."""

POLISHING_STEPS = 4
"""Steps that are taken with the slopes of a coarser fit."""

LEAST_STEP = 0.004
"""Turns below which a step is not taken; one turn of a well's place moves a front by a cell."""

CHEAP_CHANGE = 0.25
"""Half the difference in turns from which such a fit takes its derivatives."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Effects fitted together: `turns` of all their knobs, and what they leave.

    `fitted` and `held_out` are whitened misfits (see `evidence.misfit`), `noise` those that the
    noise alone leads one to expect of both; `error` and `fitted_error` the relative L2 errors of
    the maps; `covariance` that of the turns, from tiles. `magnified` is how many times more than
    the model without any effect it makes, in either part, of what nobody knows of the sand.
    """

    members: tuple[Candidate, ...]
    turns: FloatArray
    fitted: float
    held_out: float
    fitted_error: float
    error: float
    covariance: FloatArray
    noise: tuple[float, float] = (0.0, 0.0)
    magnified: tuple[float, float] = (1.0, 1.0)

    @property
    def possible(self) -> bool:
        """Whether the model could run with it."""
        return math.isfinite(self.fitted)

    @property
    def label(self) -> str:
        """The members' labels."""
        return ' + '.join(member.label for member in self.members) or 'none'

    @property
    def effects(self) -> tuple[EffectDescription, ...]:
        """The fitted effects."""
        return described(self.members, self.turns)

    def parts(self) -> Iterable[tuple[Candidate, FloatArray, FloatArray]]:
        """Yield each member with its turns and their standard deviations."""
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        turns, deviations = (_own(self.members, each) for each in (self.turns, deviation))
        for (member, own), (_, own_deviation) in zip(turns, deviations, strict=True):
            yield member, own, own_deviation


def described(members: Sequence[Candidate], turns: FloatArray) -> tuple[EffectDescription, ...]:
    """Return the effects of `members` at `turns`, all their knobs in a row."""
    return tuple(member.described(own.tolist()) for member, own in _own(members, turns))


def _own(
    members: Sequence[Candidate], values: FloatArray
) -> Iterator[tuple[Candidate, FloatArray]]:
    """Yield each of `members` with those of `values`, one per knob of all, that are its own."""
    start = 0
    for member in members:
        end = start + len(member.knobs)
        yield member, values[start:end]
        start = end


class Fitter:
    """Fits combinations of candidates to recordings of one rig, the same effect size in all."""

    def __init__(
        self,
        forwards: Sequence[Forward],
        *,
        soft: float = 0.0,
        rough: Sequence[Sequence[Forward]] = (),
        pool: ThreadPoolExecutor | None = None,
    ) -> None:
        """Compare through `forwards`; `soft` is the blur [cells] that their maps lack. `rough` are
        others of the same recordings, each on sand that is a little different."""
        self.forwards = forwards
        self.samples = [forward.sample for forward in forwards]
        self.soft = soft
        self.rough = rough
        self._roughened: dict[str, FloatArray] = {}
        self._pool = pool

    def residuals(
        self, effects: Sequence[EffectDescription], width: float, *, fitted_only: bool = False
    ) -> list[FloatArray]:
        """Return the whitened residuals of every recording, of all or of the fitted frames."""
        return [
            forward.sample.whitened(
                forward.maps(effects, fitted_only=fitted_only), width=width, soft=self.soft
            )
            for forward in self.forwards
        ]

    def fit(
        self,
        members: Sequence[Candidate],
        *,
        start: FloatArray | None = None,
        coarse_steps: int = 3,
        fine_steps: int = 3,
    ) -> Fit:
        """Return the best fit of `members` together, from `start` or their own first turns; that is
        not `possible` where the model cannot run with them.

        Effects of the camera alone need no simulation and may take many more steps.
        """
        if _cheap(members):
            coarse_steps, fine_steps = (CHEAP_STEPS * steps for steps in (coarse_steps, fine_steps))
        knobs = [knob for member in members for knob in member.knobs]
        turns = np.concatenate([member.first for member in members]) if start is None else start
        turns = np.array(turns, dtype=float)
        if coarse_steps:
            turns = self._descend(members, knobs, turns, COARSE_WIDTH, coarse_steps)
        if fine_steps:
            turns = self._descend(members, knobs, turns, WIDTH, fine_steps)
        return self.judged(members, turns)

    def polished(self, fit: Fit, coarser: 'Fitter') -> Fit:
        """Return `fit` refined with the slopes that `coarser` sees, which are nearly the same.

        A step then takes one simulation on the fine cells instead of one per knob.
        """
        if _cheap(fit.members):
            return self.fit(fit.members, start=fit.turns, coarse_steps=0, fine_steps=1)
        knobs = [knob for member in fit.members for knob in member.knobs]
        try:
            base = coarser._fitted_residuals(fit.members, fit.turns, WIDTH)
        except InputError:
            return self.judged(fit.members, fit.turns)
        slopes = coarser._jacobian(fit.members, knobs, fit.turns, base, WIDTH)
        turns = self._descend(fit.members, knobs, fit.turns, WIDTH, POLISHING_STEPS, slopes)
        polished = self.judged(fit.members, turns)
        return polished if polished.possible else self.judged(fit.members, fit.turns)

    def judged(self, members: Sequence[Candidate], turns: FloatArray) -> Fit:
        """Return what `members` at `turns` leave, fitted and held out; no covariance yet."""
        effects = described(members, turns)
        try:
            maps = [forward.maps(effects) for forward in self.forwards]
        except InputError:  # so strong an effect that the model cannot run with it
            return _impossible(members, turns)
        residuals = [
            sample.whitened(shown, soft=self.soft)
            for sample, shown in zip(self.samples, maps, strict=True)
        ]
        fitted, held_out = misfit(self.samples, residuals)
        size = len(turns)
        return Fit(
            tuple(members),
            np.array(turns, dtype=float),
            fitted,
            held_out,
            self._error(maps, held_out=False),
            self._error(maps, held_out=True),
            np.zeros((size, size)),
            noise_misfit(self.samples, residuals),
            self._magnified(effects),
        )

    def _magnified(self, effects: Sequence[EffectDescription]) -> tuple[float, float]:
        """Return how many times more than without them a little rough sand changes the maps with
        `effects`, at least once, fitted and held out; not asked where the front is stable.

        A thinner tracer fingers, and where it does is chance (Saffman and Taylor, Proc. R. Soc. A
        245 (1958) 312).
        """
        if not any(_is_unstable(effect) for effect in effects):
            return 1.0, 1.0
        with_them, without = self._on_rough_sand(effects), self._on_rough_sand(())
        fitted, held_out = np.maximum(with_them / np.maximum(without, 1e-9), 1.0)
        return float(fitted), float(held_out)

    def _on_rough_sand(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return what rough sand changes in the maps, a misfit, fitted and held out; asked once."""
        key = repr(effects)
        if key not in self._roughened:
            self._roughened[key] = self._change_on_rough_sand(effects)
        return self._roughened[key]

    def _change_on_rough_sand(self, effects: Sequence[EffectDescription]) -> FloatArray:
        smooth = self.residuals(effects, WIDTH)
        squares = np.zeros(2)
        for forwards in self.rough:
            for forward, smooth_one in zip(forwards, self.forwards, strict=True):
                forward.offset = smooth_one.offset
            changed = Fitter(forwards, soft=self.soft).residuals(effects, WIDTH)
            changes = [after - before for before, after in zip(smooth, changed, strict=True)]
            squares += np.square(misfit(self.samples, changes))
        return np.sqrt(squares / max(len(self.rough), 1))

    def _error(self, maps: Sequence[FloatArray], *, held_out: bool) -> float:
        errors = [
            sample.relative_error(shown, held_out=held_out)
            for sample, shown in zip(self.samples, maps, strict=True)
        ]
        return float(np.sqrt(np.mean(np.square(errors))))

    def distance(self, one: Fit, other: Fit) -> float:
        """Return the whitened root mean square difference of two predictions, per cell with tracer.

        It is free of noise, which both are compared with.
        """
        pairs = zip(
            self.residuals(one.effects, WIDTH), self.residuals(other.effects, WIDTH), strict=True
        )
        total = sum(float(np.sum((first - second) ** 2)) for first, second in pairs)
        return float(np.sqrt(total / max(sum(sample.active for sample in self.samples), 1)))

    def with_covariance(self, fit: Fit) -> Fit:
        """Return `fit` with the covariance of its turns, residuals of a tile counting as one."""
        knobs = [knob for member in fit.members for knob in member.knobs]
        if not knobs:
            return fit
        residuals = self._fitted_residuals(fit.members, fit.turns, WIDTH)
        jacobians = self._jacobian(fit.members, knobs, fit.turns, residuals, WIDTH)
        normal = np.zeros((len(knobs), len(knobs)))
        spread = np.zeros_like(normal)
        for residual, columns in zip(residuals, jacobians, strict=True):
            flat = columns.reshape(len(knobs), -1)
            normal += flat @ flat.T
            scores = _tile_sums(columns * residual)
            spread += scores @ scores.T
        inverse = np.linalg.pinv(normal + 1e-9 * np.trace(normal) * np.eye(len(knobs)))
        covariance = inverse @ spread @ inverse
        return Fit(**{**fit.__dict__, 'covariance': covariance})

    def responses(
        self, members: Sequence[Candidate], turns: FloatArray, *, first: int = 0
    ) -> list[FloatArray]:
        """Return d prediction / d turn, whitened, of all frames: (knobs, nt, nz', nx') each, for
        the knobs from the `first` on."""
        knobs = [knob for member in members for knob in member.knobs]
        acting = [
            member.described(own.tolist())
            for member, own in _own(members, turns)
            if not member.is_absent(own.tolist())
        ]
        base = self.residuals(acting, WIDTH)
        return self._jacobian(members, knobs, turns, base, WIDTH, fitted_only=False, first=first)

    def _fitted_residuals(
        self, members: Sequence[Candidate], turns: FloatArray, width: float
    ) -> list[FloatArray]:
        return self.residuals(described(members, turns), width, fitted_only=True)

    def _jacobian(
        self,
        members: Sequence[Candidate],
        knobs: Sequence[Knob],
        turns: FloatArray,
        base: Sequence[FloatArray],
        width: float,
        *,
        fitted_only: bool = True,
        first: int = 0,
    ) -> list[FloatArray]:
        """Return minus d residual / d turn by differences that stay in range, of the knobs from the
        `first` on.

        One-sided where every point is a simulation; central where none is.
        """

        def at(index: int, turn: float) -> Sequence[FloatArray]:
            if turn == turns[index]:
                return base
            moved = turns.copy()
            moved[index] = turn
            return self.residuals(described(members, moved), width, fitted_only=fitted_only)

        def column(index: int) -> list[FloatArray]:
            for begin, end in _spans(knobs[index], turns[index], cheap=_cheap(members)):
                try:
                    pairs = zip(at(index, begin), at(index, end), strict=True)
                except InputError:  # the model cannot run there
                    continue
                return [(before - after) / (end - begin) for before, after in pairs]
            return [np.zeros_like(residual) for residual in base]

        run: Callable[..., Iterable[list[FloatArray]]] = (
            map if self._pool is None else self._pool.map
        )
        columns = list(run(column, range(first, len(knobs))))
        return [np.stack([part[n] for part in columns]) for n in range(len(base))]

    def _descend(
        self,
        members: Sequence[Candidate],
        knobs: Sequence[Knob],
        turns: FloatArray,
        width: float,
        steps: int,
        slopes: list[FloatArray] | None = None,
    ) -> FloatArray:
        """Return the turns after at most `steps`; `slopes`, where given, stand for all of them."""
        low = np.array([knob.range[0] for knob in knobs])
        high = np.array([knob.range[1] for knob in knobs])
        turns = np.clip(turns, low, high)
        try:
            residuals = self._fitted_residuals(members, turns, width)
        except InputError:
            return turns
        cost = _sum_of_squares(residuals)
        damping = 1e-3
        for _ in range(steps):
            jacobians = slopes or self._jacobian(members, knobs, turns, residuals, width)
            normal, gradient = _normal_equations(jacobians, residuals)
            accepted = False
            for _ in range(TRIALS if slopes is None else 1):
                step = _bounded_step(normal, gradient, damping, turns, low, high)
                if np.abs(step).max() < LEAST_STEP:
                    return turns
                trial = np.clip(turns + step, low, high)
                try:
                    trial_residuals = self._fitted_residuals(members, trial, width)
                    trial_cost = _sum_of_squares(trial_residuals)
                except InputError:
                    trial_cost = np.inf
                if trial_cost < cost:
                    accepted = True
                    break
                damping = max(10 * damping, 1e-2)
            if not accepted:
                return turns
            gain = 1.0 - trial_cost / cost
            turns, residuals, cost = trial, trial_residuals, trial_cost
            damping *= 0.2
            if gain < LEAST_GAIN:
                return turns
        return turns


def _spans(knob: Knob, turn: float, *, cheap: bool) -> list[tuple[float, float]]:
    """Return the differences in turns that a derivative at `turn` may be taken from, the best
    first, within the range of `knob`."""
    low, high = knob.range
    if cheap:
        spans = [(max(turn - CHEAP_CHANGE, low), min(turn + CHEAP_CHANGE, high))]
    else:
        down = (turn, max(turn - 1.0, low))
        spans = [(turn, turn + 1.0), down] if turn + 1.0 <= high else [down]
    return [(begin, end) for begin, end in spans if begin != end]


def _impossible(members: Sequence[Candidate], turns: FloatArray) -> Fit:
    """Return `members` at `turns` with which the model cannot run."""
    size = len(turns)
    unknown = (math.inf,) * 4
    return Fit(tuple(members), np.array(turns, dtype=float), *unknown, np.zeros((size, size)))


def _is_unstable(effect: EffectDescription) -> bool:
    """Return whether `effect` lets a front finger: a tracer thinner than water."""
    return float(effect.parameters.get('viscosity_ratio', 1.0)) < 1.0


def _cheap(members: Sequence[Candidate]) -> bool:
    """Return whether all `members` are effects of the camera, which need no simulation."""
    return all(member.effect in IMAGE for member in members)


def _sum_of_squares(residuals: Sequence[FloatArray]) -> float:
    return float(sum(np.sum(residual**2) for residual in residuals))


def _normal_equations(
    jacobians: Sequence[FloatArray], residuals: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    size = len(jacobians[0])
    normal, gradient = np.zeros((size, size)), np.zeros(size)
    for columns, residual in zip(jacobians, residuals, strict=True):
        flat = columns.reshape(size, -1)
        normal += flat @ flat.T
        gradient += flat @ residual.ravel()
    return normal, gradient


def _bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    damping: float,
    turns: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Return the damped step with knobs at a bound that point outward held fixed."""
    free = ~(((turns <= low) & (gradient < 0)) | ((turns >= high) & (gradient > 0)))
    step = np.zeros_like(gradient)
    if not free.any():
        return step
    part = normal[np.ix_(free, free)]
    diagonal = np.diag(part) + 1e-9 * max(float(np.trace(part)), 1e-30)
    step[free] = np.linalg.solve(part + np.diag(damping * diagonal + 1e-30), gradient[free])
    return np.clip(step, -LARGEST_STEP, LARGEST_STEP)


LARGEST_STEP = 30.0
"""Most natural steps that one iteration may turn a knob."""


def _tile_sums(values: FloatArray) -> FloatArray:
    """Return the sums of `values` (p, nt, nz, nx) over all frames of every tile, (p, tiles)."""
    total = values.sum(axis=1)
    rows = np.add.reduceat(total, np.arange(0, total.shape[1], TILE), axis=1)
    tiles = np.add.reduceat(rows, np.arange(0, rows.shape[2], TILE), axis=2)
    return tiles.reshape(len(values), -1)
