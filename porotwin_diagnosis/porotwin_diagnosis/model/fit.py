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
from porotwin_diagnosis.data.sample import COARSE_WIDTH, WIDTH, misfit, noise_misfit
from porotwin_diagnosis.model.forward import Forward
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter

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
"""Turns below which a step is not taken; one scaled of a well's place moves a front by a cell."""

CHEAP_CHANGE = 0.25
"""Half the difference in scaled from which such a fit takes its derivatives."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Effects fitted together: `scaled` of all their parameters, and what they leave.

    `fitted` and `held_out` are whitened misfits (see `evidence.misfit`), `noise` those that the
    noise alone leads one to expect of both; `error` and `fitted_error` the relative L2 errors of
    the maps; `covariance` that of the scaled, from tiles. `fingering_amplification` is
    the ratio by which the model amplifies a small random change of permeability, relative to the
    model without any effect: (fitted, held out).
    """

    members: tuple[Candidate, ...]
    scaled: FloatArray
    fitted: float
    held_out: float
    fitted_error: float
    error: float
    covariance: FloatArray
    noise: tuple[float, float] = (0.0, 0.0)
    fingering_amplification: tuple[float, float] = (1.0, 1.0)

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
        return described(self.members, self.scaled)

    def parts(self) -> Iterable[tuple[Candidate, FloatArray, FloatArray]]:
        """Yield each member with its scaled and their standard deviations."""
        deviation = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        scaled, deviations = (_own(self.members, each) for each in (self.scaled, deviation))
        for (member, own), (_, own_deviation) in zip(scaled, deviations, strict=True):
            yield member, own, own_deviation


def described(members: Sequence[Candidate], scaled: FloatArray) -> tuple[EffectDescription, ...]:
    """Return the effects of `members` at `scaled`, all their parameters in a row."""
    return tuple(member.described(own.tolist()) for member, own in _own(members, scaled))


def _own(
    members: Sequence[Candidate], values: FloatArray
) -> Iterator[tuple[Candidate, FloatArray]]:
    """Yield each of `members` with its own part of `values`."""
    start = 0
    for member in members:
        end = start + len(member.parameters)
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
        """Return the best fit of `members` together, from `start` or their own first values.

        The result is not `possible` where the model cannot run with them.

        Effects of the camera alone need no simulation and may take many more steps.
        """
        if _cheap(members):
            coarse_steps, fine_steps = (CHEAP_STEPS * steps for steps in (coarse_steps, fine_steps))
        parameters = [parameter for member in members for parameter in member.parameters]
        scaled = np.concatenate([member.first for member in members]) if start is None else start
        scaled = np.array(scaled, dtype=float)
        if coarse_steps:
            scaled = self._descend(members, parameters, scaled, COARSE_WIDTH, coarse_steps)
        if fine_steps:
            scaled = self._descend(members, parameters, scaled, WIDTH, fine_steps)
        return self.judged(members, scaled)

    def polished(self, fit: Fit, coarser: 'Fitter') -> Fit:
        """Return `fit` refined with the slopes that `coarser` sees, which are nearly the same.

        A step then takes one simulation on the fine cells instead of one per parameter.
        """
        if _cheap(fit.members):
            return self.fit(fit.members, start=fit.scaled, coarse_steps=0, fine_steps=1)
        parameters = [parameter for member in fit.members for parameter in member.parameters]
        try:
            base = coarser._fitted_residuals(fit.members, fit.scaled, WIDTH)
        except InputError:
            return self.judged(fit.members, fit.scaled)
        slopes = coarser._jacobian(fit.members, parameters, fit.scaled, base, WIDTH)
        scaled = self._descend(fit.members, parameters, fit.scaled, WIDTH, POLISHING_STEPS, slopes)
        polished = self.judged(fit.members, scaled)
        return polished if polished.possible else self.judged(fit.members, fit.scaled)

    def judged(self, members: Sequence[Candidate], scaled: FloatArray) -> Fit:
        """Return what `members` at `scaled` leave, fitted and held out; no covariance yet."""
        effects = described(members, scaled)
        try:
            maps = [forward.maps(effects) for forward in self.forwards]
        except InputError:  # so strong an effect that the model cannot run with it
            return _impossible(members, scaled)
        residuals = [
            sample.whitened(shown, soft=self.soft)
            for sample, shown in zip(self.samples, maps, strict=True)
        ]
        fitted, held_out = misfit(self.samples, residuals)
        size = len(scaled)
        return Fit(
            tuple(members),
            np.array(scaled, dtype=float),
            fitted,
            held_out,
            self._error(maps, held_out=False),
            self._error(maps, held_out=True),
            np.zeros((size, size)),
            noise_misfit(self.samples, residuals),
            self._fingering_amplification(effects),
        )

    def _fingering_amplification(self, effects: Sequence[EffectDescription]) -> tuple[float, float]:
        """Return how many times more than without them a little rough sand changes the maps with
        `effects`, at least once, fitted and held out; not asked where the front is stable.

        A thinner tracer fingers, and where it does is chance (Saffman and Taylor, Proc. R. Soc. A
        245 (1958) 312).
        """
        if not any(EFFECTS[e.name].destabilises_fronts(e.parameters) for e in effects):
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
        """Return `fit` with the covariance of its scaled, residuals of a tile counting as one."""
        parameters = [parameter for member in fit.members for parameter in member.parameters]
        if not parameters:
            return fit
        residuals = self._fitted_residuals(fit.members, fit.scaled, WIDTH)
        jacobians = self._jacobian(fit.members, parameters, fit.scaled, residuals, WIDTH)
        normal = np.zeros((len(parameters), len(parameters)))
        spread = np.zeros_like(normal)
        for residual, columns in zip(residuals, jacobians, strict=True):
            flat = columns.reshape(len(parameters), -1)
            normal += flat @ flat.T
            scores = _tile_sums(columns * residual)
            spread += scores @ scores.T
        inverse = np.linalg.pinv(normal + 1e-9 * np.trace(normal) * np.eye(len(parameters)))
        covariance = inverse @ spread @ inverse
        return Fit(**{**fit.__dict__, 'covariance': covariance})

    def responses(
        self, members: Sequence[Candidate], scaled: FloatArray, *, first: int = 0
    ) -> list[FloatArray]:
        """Return d prediction / d scaled, whitened, of all frames: (parameters, nt, nz', nx')
        each, for the parameters from the `first` on."""
        parameters = [parameter for member in members for parameter in member.parameters]
        acting = [
            member.described(own.tolist())
            for member, own in _own(members, scaled)
            if not member.is_absent(own.tolist())
        ]
        base = self.residuals(acting, WIDTH)
        return self._jacobian(
            members, parameters, scaled, base, WIDTH, fitted_only=False, first=first
        )

    def _fitted_residuals(
        self, members: Sequence[Candidate], scaled: FloatArray, width: float
    ) -> list[FloatArray]:
        return self.residuals(described(members, scaled), width, fitted_only=True)

    def _jacobian(
        self,
        members: Sequence[Candidate],
        parameters: Sequence[FitParameter],
        scaled: FloatArray,
        base: Sequence[FloatArray],
        width: float,
        *,
        fitted_only: bool = True,
        first: int = 0,
    ) -> list[FloatArray]:
        """Return minus d residual / d scaled by differences that stay in range, of the parameters
        from the `first` on.

        One-sided where every point is a simulation; central where none is.
        """

        def at(index: int, value: float) -> Sequence[FloatArray]:
            if value == scaled[index]:
                return base
            moved = scaled.copy()
            moved[index] = value
            return self.residuals(described(members, moved), width, fitted_only=fitted_only)

        def column(index: int) -> list[FloatArray]:
            for begin, end in _spans(parameters[index], scaled[index], cheap=_cheap(members)):
                try:
                    pairs = zip(at(index, begin), at(index, end), strict=True)
                except InputError:  # the model cannot run there
                    continue
                return [(before - after) / (end - begin) for before, after in pairs]
            return [np.zeros_like(residual) for residual in base]

        run: Callable[..., Iterable[list[FloatArray]]] = (
            map if self._pool is None else self._pool.map
        )
        columns = list(run(column, range(first, len(parameters))))
        return [np.stack([part[n] for part in columns]) for n in range(len(base))]

    def _descend(
        self,
        members: Sequence[Candidate],
        parameters: Sequence[FitParameter],
        scaled: FloatArray,
        width: float,
        steps: int,
        slopes: list[FloatArray] | None = None,
    ) -> FloatArray:
        """Return the scaled after at most `steps`; `slopes`, where given, stand for all of them."""
        low = np.array([parameter.range[0] for parameter in parameters])
        high = np.array([parameter.range[1] for parameter in parameters])
        scaled = np.clip(scaled, low, high)
        try:
            residuals = self._fitted_residuals(members, scaled, width)
        except InputError:
            return scaled
        cost = _sum_of_squares(residuals)
        damping = 1e-3
        for _ in range(steps):
            jacobians = slopes or self._jacobian(members, parameters, scaled, residuals, width)
            normal, gradient = _normal_equations(jacobians, residuals)
            accepted = False
            for _ in range(TRIALS if slopes is None else 1):
                step = _bounded_step(normal, gradient, damping, scaled, low, high)
                if np.abs(step).max() < LEAST_STEP:
                    return scaled
                trial = np.clip(scaled + step, low, high)
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
                return scaled
            gain = 1.0 - trial_cost / cost
            scaled, residuals, cost = trial, trial_residuals, trial_cost
            damping *= 0.2
            if gain < LEAST_GAIN:
                return scaled
        return scaled


def _spans(parameter: FitParameter, scaled: float, *, cheap: bool) -> list[tuple[float, float]]:
    """Return the differences in scaled that a derivative at `scaled` may be taken from, the best
    first, within the range of `parameter`."""
    low, high = parameter.range
    if cheap:
        spans = [(max(scaled - CHEAP_CHANGE, low), min(scaled + CHEAP_CHANGE, high))]
    else:
        down = (scaled, max(scaled - 1.0, low))
        spans = [(scaled, scaled + 1.0), down] if scaled + 1.0 <= high else [down]
    return [(begin, end) for begin, end in spans if begin != end]


def _impossible(members: Sequence[Candidate], scaled: FloatArray) -> Fit:
    """Return `members` at `scaled` with which the model cannot run."""
    size = len(scaled)
    unknown = (math.inf,) * 4
    return Fit(tuple(members), np.array(scaled, dtype=float), *unknown, np.zeros((size, size)))


def _cheap(members: Sequence[Candidate]) -> bool:
    """Return whether all `members` are effects of the camera, which need no simulation."""
    return not any(EFFECTS[member.effect].needs_simulation for member in members)


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
    scaled: FloatArray,
    low: FloatArray,
    high: FloatArray,
) -> FloatArray:
    """Return the damped step with parameters at a bound that point outward held fixed."""
    free = ~(((scaled <= low) & (gradient < 0)) | ((scaled >= high) & (gradient > 0)))
    step = np.zeros_like(gradient)
    if not free.any():
        return step
    part = normal[np.ix_(free, free)]
    diagonal = np.diag(part) + 1e-9 * max(float(np.trace(part)), 1e-30)
    step[free] = np.linalg.solve(part + np.diag(damping * diagonal + 1e-30), gradient[free])
    return np.clip(step, -LARGEST_STEP, LARGEST_STEP)


LARGEST_STEP = 30.0
"""Most natural steps that one iteration may move a parameter."""


def _tile_sums(values: FloatArray) -> FloatArray:
    """Return the sums of `values` (p, nt, nz, nx) over all frames of every tile, (p, tiles)."""
    total = values.sum(axis=1)
    rows = np.add.reduceat(total, np.arange(0, total.shape[1], TILE), axis=1)
    tiles = np.add.reduceat(rows, np.arange(0, rows.shape[2], TILE), axis=2)
    return tiles.reshape(len(values), -1)
