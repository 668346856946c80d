"""Training of a network through free runs: the gradient passes the solver by its adjoint.

A roll-out starts at an observed map and continues from its own corrected maps:

    c~_k = P c_{k-1},    c_k = clip(c~_k + dt sigma(c~_k) / phi)

Its loss is the mean square of c_k minus the observed map over all steps k, weighted by the
deviations of the maps. One step cannot show an error that only grows over many, and learns the
noise of the map that it starts from. Roll-outs grow from stage to stage (Um et al., Solver-in-the-
Loop, NeurIPS 2020; List et al., arXiv 2402.12971).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.learnt_solver import StepModel
from porotwin_core.rates.wells import WellRate
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.data.frames import Frames, rate_vector, sequences


class Stage(NamedTuple):
    """Roll-outs of `steps` steps, `updates` times `batch` of them."""

    steps: int
    updates: int
    batch: int = 2

    def shortened(self, share: float) -> 'Stage':
        """Return the stage with this share of its updates, at most all and at least one."""
        return self._replace(updates=max(1, round(min(share, 1.0) * self.updates)))


CURRICULUM = (Stage(5, 30), Stage(20, 10), Stage(40, 5))
"""The roll-outs grow; a few long ones are enough after many short ones."""

LEARNING_RATE = 5e-4
"""First step size of Adam: a sixth of the one of single steps, which it continues."""

LARGEST_GRADIENT = 1.0
"""Largest norm of a gradient [-]: one roll-out with a large error must not undo the others."""

WEIGHED_DEVIATION = 0.01
"""Deviation [-] whose square is added to that of the maps: errors of the maps that they do not
tell. A cell of a larger deviation counts less."""

JudgeFn = Callable[[CorrectiveModel], float]
"""Returns the error [-] of kept free runs with a model; the model of least error is kept."""


@dataclass(frozen=True)
class Run:
    """A sequence of maps with the rates of every step; `weight` is (maps, nz, nx), 0 if unseen."""

    maps: FloatArray
    weight: FloatArray
    rates: tuple[dict[str, WellRate], ...]

    @classmethod
    def of(cls, frames: Frames) -> 'Run':
        """Return the run of frames without interruption and at equal intervals."""
        seen = np.isfinite(frames.concentration)
        weight = seen.astype(float)
        if frames.deviation is not None:
            variance = np.square(frames.deviation) + WEIGHED_DEVIATION**2
            weight = np.where(seen, WEIGHED_DEVIATION**2 / np.nan_to_num(variance, nan=1.0), 0.0)
        pairs = zip(frames.times, frames.times[1:], strict=False)
        rates = tuple(frames.schedule.mean(float(a), float(b)) for a, b in pairs)
        return cls(np.nan_to_num(frames.concentration).astype(float), weight, rates)


class RollOuts:
    """The loss of roll-outs of one model, and its gradient by the weights of the network."""

    def __init__(self, model: CorrectiveModel, step: StepModel) -> None:
        """Run `step`, corrected by `model`."""
        self._model, self._step = model, step
        empty = np.zeros(model.grid.shape)
        rest = step.predict(empty, {}, model.time_step)
        unit = step.correct(empty, np.ones(model.grid.shape), {}, model.time_step)
        self._gain = (unit - rest) * model.scaling.sigma

    def add_gradient(self, run: Run, first: int, steps: int) -> float:
        """Add the gradient of one roll-out from map `first` to the weights; return its loss."""
        weights = [one for one in self._model.network.parameters() if one.requires_grad]
        states, answers, loss, bars = [run.maps[first]], [], 0.0, []
        for k in range(first, first + steps):
            scaled, answer, corrected = self._corrected(states[-1], run, k)
            answers.append((scaled, answer))
            error = np.clip(corrected, 0.0, 1.0) - run.maps[k + 1]
            weight = run.weight[k + 1] / (steps * max(run.weight[k + 1].sum(), 1.0))
            loss += float(np.sum(weight * error**2))
            bars.append((2.0 * weight * error, (corrected >= 0.0) & (corrected <= 1.0)))
            states.append(np.clip(corrected, 0.0, 1.0))
        bar: FloatArray = np.zeros(self._model.grid.shape)
        for k in range(steps - 1, -1, -1):
            own, inside = bars[k]
            bar = (bar + own) * inside
            scaled, answer = answers[k]
            by = torch.as_tensor(bar * self._gain, dtype=torch.float32)[None]
            with _without_denormals():
                found = torch.autograd.grad(answer, [scaled, *weights], by)
            for weight, gradient in zip(weights, found[1:], strict=True):
                weight.grad = gradient if weight.grad is None else weight.grad + gradient
            if k == 0:
                break
            bar = bar + found[0][0].numpy() / self._model.scaling.spread
            rates = run.rates[first + k]
            bar = self._step.step_adjoint(states[k], rates, self._model.time_step, bar)
        return loss

    def _corrected(self, state: FloatArray, run: Run, k: int) -> tuple[Tensor, Tensor, FloatArray]:
        """Return scaled c~, scaled sigma with its graph, and the corrected map, not clipped."""
        model = self._model
        predicted = self._step.predict(state, run.rates[k], model.time_step)
        scaled = torch.as_tensor(model.scaling.concentration(predicted), dtype=torch.float32)[None]
        scaled.requires_grad_()
        rates = rate_vector(run.rates[k], model.wells) / model.scaling.rate
        answer = model.network(scaled, torch.as_tensor(rates, dtype=torch.float32).reshape(1, -1))
        return scaled, answer, predicted + self._gain * answer.detach()[0].numpy()


def train_through_runs(
    model: CorrectiveModel,
    step: StepModel,
    experiments: Sequence[Frames],
    judge: JudgeFn,
    *,
    seed: int,
    curriculum: Sequence[Stage] = CURRICULUM,
    say: Callable[[str], None] = lambda _: None,
) -> CorrectiveModel:
    """Return `model` with weights trained on through free runs, or the given ones if not better.

    Args:
        model: trained on single steps; its weights are changed in place.
        step: the physics-based model that it corrects.
        experiments: the maps to learn from.
        judge: the error of kept free runs; it is asked after every stage.
        seed: of the choice of roll-outs.
        curriculum: the stages; the weights after the best one are kept.
        say: told the error after every stage.
    """
    runs = [Run.of(part) for frames in experiments for part in sequences(frames)]
    runs = [run for run in runs if len(run.rates) > 0]
    network, random = model.network, np.random.default_rng(seed)
    optimiser = torch.optim.Adam(network.parameters(), lr=LEARNING_RATE)
    rollouts = RollOuts(model, step)
    whole = replace(model, trust=1.0)
    best, best_weights = judge(model), _copied(network.state_dict())
    best_trust = model.trust
    for stage in curriculum:
        for _ in range(stage.updates):
            optimiser.zero_grad()
            for _ in range(stage.batch):
                run = runs[random.choice(len(runs), p=_shares(runs))]
                steps = min(stage.steps, len(run.rates))
                first = int(random.integers(len(run.rates) - steps + 1))
                rollouts.add_gradient(run, first, steps)
            torch.nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
            optimiser.step()
        error = judge(whole)
        say(f'roll-outs of {stage.steps} steps: error of the kept free runs {error:.4f}')
        if error < best:
            best, best_trust, best_weights = error, 1.0, _copied(network.state_dict())
    network.load_state_dict(best_weights)
    return replace(model, trust=best_trust)


@contextmanager
def _without_denormals() -> Iterator[None]:
    """Round the smallest numbers to zero: far from the tracer, they slow a gradient tenfold."""
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


def _copied(weights: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in weights.items()}


def _shares(runs: Sequence[Run]) -> FloatArray:
    counts = np.array([len(run.rates) for run in runs], dtype=float)
    shares: FloatArray = counts / counts.sum()
    return shares
