"""What was learnt, in words of physics: for the report of a training.

Two questions. Which share of the gap between model and maps do a named effect and COSTA take
(`gap_shares`)? And which effects does the network's sigma look like (`look_alikes`)?

An effect e changes a step of the model by a source of its own, sigma_e = phi (c_e - c~) / dt. The
sigma of the network is fitted by such sources over many steps, by least squares. Effects are added
one after another, each time the one that explains most (orthogonal matching pursuit).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import percent
from porotwin_core.geometry.grid import FloatArray, fill_unseen
from porotwin_core.model.fitted_effect import Candidate
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver, Place
from porotwin_core.rates.wells import WellRates
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.corrective_source import corrective_source
from porotwin_costa.correction.free_run_gate import Judge
from porotwin_costa.data.frames import Frames, mean_rates
from porotwin_costa.physics.learnable import Learnable, with_part
from porotwin_costa.physics.physics_fit import COMPARED_FRAMES

LOOKED_AT = 6
"""Places of leaks and patches that are tried: where sigma is largest."""

MOST_LOOK_ALIKES = 3
"""Most effects that are named."""

LEAST_SHARE = 0.05
"""Share of the squared sigma that an effect must explain to be named [-]."""


def gap_shares(bare: Judge, judge: Judge, model: CorrectiveModel) -> dict[str, float]:
    """Return the shares of the squared error of free runs that each part of the model takes [-].

    Args:
        bare: free runs of the model without any named effect.
        judge: the same runs of the model with the named effects.
        model: the correction of the latter.

    The three shares add up to 1; one is negative where a part makes the runs worse.
    """
    errors = judge.errors(model)
    none = float(np.mean(bare.alone**2)) or 1.0
    named = float(np.mean(errors.alone**2)) / none
    rest = float(np.mean(errors.corrected**2)) / none
    return {'named effects': 1.0 - named, 'COSTA': named - rest, 'remainder': rest}


@dataclass(frozen=True)
class LookAlikes:
    """Shares of the squared sigma [-] by effect, the largest first, and the share of none."""

    shares: Mapping[str, float]
    unexplained: float

    @property
    def text(self) -> str:
        """One line for a person."""
        if not self.shares:
            return 'what the network learnt looks like no known effect'
        named = ', '.join(f'{percent(share)} {name}' for name, share in self.shares.items())
        rest = percent(self.unexplained)
        return f'what the network learnt looks like {named}, {rest} like no effect'


def look_alikes(
    model: CorrectiveModel, experiments: Sequence[Frames], solver: LearntSolver
) -> LookAlikes:
    """Return the effects that the sigma of the network looks like on the maps of `experiments`.

    The physics that was learnt before the network counts as known.

    Raises:
        InputError: the model cannot run without these effects.
    """
    known = model.learnt or LearntPhysics()
    steps = list(_steps(experiments))
    predicted = [_predicted(solver, known, step) for step in steps]
    asked = replace(model, learnt=None)
    answers = [
        corrective_source(asked, one, step.rates, step.length).sigma
        for one, step in zip(predicted, steps, strict=True)
    ]
    zero = np.zeros(model.grid.shape)
    sigma = np.array([zero if answer is None else answer for answer in answers])
    if not sigma.any():
        return LookAlikes({}, 1.0)
    source_of = solver.model(known).source_of

    def source(part: Candidate, values: FloatArray) -> FloatArray:
        physics = with_part(known, part, values)
        moved = [_predicted(solver, physics, step) for step in steps]
        pairs = zip(moved, predicted, steps, strict=True)
        return np.array([source_of(a - b, step.length) for a, b, step in pairs])

    candidates = []
    for part in _parts(Learnable.of(solver, model.grid, experiments), sigma):
        try:
            columns = [source(part, values).ravel() for values in _directions(part)]
        except InputError:  # a model that cannot have this part
            continue
        candidates.append(EffectSources(part.effect, np.stack(columns, axis=1)))
    return matched(sigma.ravel(), candidates)


@dataclass(frozen=True)
class _Step:
    before: FloatArray
    rates: WellRates
    length: float


def _steps(experiments: Sequence[Frames]) -> Iterator[_Step]:
    """Yield COMPARED_FRAMES steps, spread evenly over all pairs of maps."""
    pairs = [(frames, n) for frames in experiments for n in range(len(frames.times) - 1)]
    chosen = np.linspace(0, len(pairs) - 1, COMPARED_FRAMES + 1).round().astype(int)[1:]
    for frames, n in (pairs[k] for k in np.unique(chosen)):
        start, end = float(frames.times[n]), float(frames.times[n + 1])
        before = fill_unseen(frames.concentration[n].astype(float), None)
        yield _Step(before, mean_rates(frames.schedule, start, end), end - start)


def _predicted(solver: LearntSolver, physics: LearntPhysics, step: _Step) -> FloatArray:
    found = solver.model(physics).predict(step.before, step.rates, step.length)
    return np.clip(found, 0.0, 1.0)


def _parts(learnable: Learnable, sigma: FloatArray) -> list[Candidate]:
    """Return the effects everywhere, and those at the places where sigma is largest."""
    grid, power = learnable.grid, np.sum(sigma**2, axis=0)

    def nearby(place: Place) -> float:
        radius = np.hypot(grid.x[None, :] - place[0], grid.z[:, None] - place[1])
        return float(np.sum(power * np.exp(-0.5 * (radius / (0.05 * learnable.size)) ** 2)))

    places = sorted(learnable.places(), key=nearby, reverse=True)[:LOOKED_AT]
    return [*learnable.everywhere(), *(part for place in places for part in learnable.at(place))]


def _directions(part: Candidate) -> list[FloatArray]:
    """Return the steps of a part at which its sources are taken: each parameter by itself.

    An effect at a place has one source, at the start of its fit.
    """
    if part.starts:
        return [np.array(part.first)]
    return list(np.eye(len(part.parameters)))


class EffectSources(NamedTuple):
    """The sources of an effect, a column (values,) for each of its unknowns."""

    effect: str
    columns: FloatArray


def matched(sigma: FloatArray, candidates: Sequence[EffectSources]) -> LookAlikes:
    """Return the shares of the effects that explain `sigma` (values,) best, one after another."""
    total = float(sigma @ sigma)
    basis, left, shares = np.zeros((len(sigma), 0)), total, {}
    for _ in range(MOST_LOOK_ALIKES):
        trials = [
            (_left(sigma, np.hstack([basis, one.columns])), one)
            for one in candidates
            if one.effect not in shares
        ]
        if not trials:
            break
        cost, best = min(trials, key=lambda trial: trial[0])
        if left - cost < LEAST_SHARE * total:
            break
        shares[best.effect] = (left - cost) / total
        basis, left = np.hstack([basis, best.columns]), cost
    return LookAlikes(shares, left / total)


def _left(sigma: FloatArray, basis: FloatArray) -> float:
    """Return the squared norm of `sigma` without its projection on the columns of `basis`."""
    weights, *_ = np.linalg.lstsq(basis, sigma, rcond=None)
    return float(np.sum((sigma - basis @ weights) ** 2))
