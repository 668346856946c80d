"""Training beside the running twin: on the pairs so far, and swapped in only when it is better.

The newest part of the pairs is kept. Free runs over it judge the new model, the one in use, and the
model without any correction. The one in use stays unless the new one is better than both.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver
from porotwin_core.rates.wells import Schedule, WellRate
from porotwin_core.rig import Rig
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import LEAST_ERROR, Judge, gated, kept_runs
from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.data.frames import Frames
from porotwin_costa.networks import Architecture
from porotwin_costa.training.training import ProgressFn, TrainingCancelledError, train

NOT_USED = '_not_used'
"""Ending of the name of a file with weights that did not replace those in use."""

LEAST_IMPROVEMENT = 0.98
"""Error of a new model relative to the one in use, below which it replaces it [-]."""

JUDGED_PAIRS = 20
"""Fewest pairs that a free run can judge: ten minutes of photographs every 30 s."""


@dataclass(frozen=True)
class LiveTraining:
    """The rig, the scheme and the solver of the model that COSTA corrects."""

    rig: Rig
    preset: str
    solver: LearntSolver

    def retrained(
        self,
        pairs: Dataset,
        current: CorrectiveModel | None,
        architecture: Architecture,
        *,
        epochs: int,
        seed: int,
        progress: ProgressFn,
        cancelled: Callable[[], bool],
    ) -> tuple[CorrectiveModel, bool]:
        """Return a model trained on `pairs`, and whether it shall replace the `current` one.

        Learnt physics of the current model stays; the network learns the remainder.

        Raises:
            InputError: too few pairs, or none with tracer to judge.
            TrainingCancelledError: `cancelled` returned True.
        """
        settings = architecture.training.with_epochs(epochs)
        frames = frames_of_pairs(pairs, self.solver)
        learnt = current.learnt if current is not None else None
        dataset = pairs if learnt is None else self._behind(learnt, frames, pairs)
        model = train(
            dataset, architecture, settings, seed=seed, progress=progress, cancelled=cancelled
        )
        model = replace(model, learnt=learnt)
        _, kept = kept_runs(frames, settings.validation_share)
        if sum(len(run.frames.times) for run in kept) < JUDGED_PAIRS:
            return model, current is None
        judge = Judge(self.solver, kept, pairs.time_step)
        judge.check()
        model = gated(model, judge)
        if cancelled():  # the free runs took a while
            raise TrainingCancelledError('stopped after its last epoch')
        gate = model.provenance['gate']
        if current is None:
            return model, True  # its gate keeps it from doing harm
        best = min(judge.errors(current).mean_corrected, gate['alone'])
        return model, _is_better(gate['corrected'], best)

    def _behind(self, learnt: LearntPhysics, frames: list[Frames], pairs: Dataset) -> Dataset:
        """Return the pairs of `frames` for the model with `learnt` physics."""
        step = self.solver.model(learnt)
        return build_dataset(
            frames,
            self.rig,
            grid=pairs.grid,
            time_step=pairs.time_step,
            predict=step.predict,
            residual=step.residual,
            preset=self.preset,
        )


def _is_better(error: float, other: float) -> bool:
    return error + LEAST_ERROR < LEAST_IMPROVEMENT * (other + LEAST_ERROR)


def not_used(output: Path) -> Path:
    """Return the file for weights that did not replace those in the file `output`."""
    return output.with_name(f'{output.stem}{NOT_USED}{output.suffix}')


def frames_of_pairs(pairs: Dataset, solver: LearntSolver) -> list[Frames]:
    """Return the observed maps of every experiment, from its predictions and residuals.

    The map before the first pair is not known. A gap between pairs begins another experiment.
    """
    unit = solver.model(LearntPhysics()).source_of(np.ones(pairs.grid.shape), pairs.time_step)
    found = []
    for number in np.unique(pairs.experiment):
        own = np.flatnonzero(pairs.experiment == number)
        own = own[np.argsort(pairs.time[own], kind='stable')]
        gaps = np.flatnonzero(np.diff(pairs.time[own]) > 1.5 * pairs.time_step) + 1
        for part in np.split(own, gaps):
            maps = pairs.predicted[part] + pairs.residual[part] / unit
            rates = [
                (float(pairs.time[n]) - pairs.time_step, _rates(pairs.wells, pairs.rates[n]))
                for n in part
            ]
            schedule = Schedule.from_rates(rates)
            found.append(Frames(pairs.time[part], np.clip(maps, 0.0, 1.0), schedule))
    return found


def _rates(wells: tuple[str, ...], vector: FloatArray) -> dict[str, WellRate]:
    return {
        name: WellRate(float(water), float(tracer / water) if water > 0 else 0.0)
        for name, (water, tracer) in zip(wells, vector, strict=True)
    }
