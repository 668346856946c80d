"""Training from observed maps: physics, network, free runs, gate.

A search of somebody else tells which physics is missing. What it finds is learnt if kept free runs
get better by it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.learnt_physics import NO_LEARNT_PHYSICS, LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver
from porotwin_core.rig import EffectDescription, Rig
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.free_run_gate import Judge, gated, kept_runs
from porotwin_costa.data.dataset import Dataset, join_datasets
from porotwin_costa.data.dataset_builder import build_dataset
from porotwin_costa.data.frames import Frames
from porotwin_costa.data.physics_id import refuse_untaught
from porotwin_costa.networks import Architecture
from porotwin_costa.training.rollout_training import CURRICULUM, Stage, train_through_runs
from porotwin_costa.training.training import ProgressFn, train

SCHEME_GAIN = 0.3
"""Share of the squared error of kept runs that a sharper scheme must take away [-]: its steps cost
many times as much. Fluxes alone seldom take away as much of it."""

SolverOn = Callable[[Grid], LearntSolver]
"""Returns a solver on a grid of the rig."""

SayFn = Callable[[str], None]
"""Tells a person a line about the progress."""

MissingFn = Callable[[Sequence[Frames], SayFn], Sequence[EffectDescription]]
"""Returns the effects that some experiments show beyond the model, as changes on top of it."""


@dataclass(frozen=True)
class Experiments:
    """Maps to learn from, and the model that COSTA corrects.

    `frames` are on `grid`, `time_step` [s] apart; `preset` names the numerical scheme of
    `solver_on`. `missing` looks for physics that the model lacks. The workers of `pool` prepare the
    pairs, an experiment each; for a pool of other processes `solver_on` must be picklable.
    `sharper` names a scheme that learnt physics may have; empty: none is tried.
    """

    rig: Rig
    grid: Grid
    frames: Sequence[Frames]
    time_step: float
    preset: str
    solver_on: SolverOn
    missing: MissingFn
    pool: Crew
    sharper: str = ''

    def pairs(self, frames: Sequence[Frames], learnt: LearntPhysics) -> Dataset:
        """Return the training pairs of `frames` for the model with `learnt` physics.

        Raises:
            InputError: no pair can be used.
        """
        settings = (self.rig, self.grid, self.time_step, self.preset, self.solver_on, learnt)
        waiting = [self.pool.submit(_pairs_of, one, *settings) for one in frames]
        usable = [one.result() for one in waiting if not isinstance(one.exception(), InputError)]
        return join_datasets(usable or [waiting[0].result()])


def _pairs_of(
    frames: Frames,
    rig: Rig,
    grid: Grid,
    time_step: float,
    preset: str,
    solver_on: SolverOn,
    learnt: LearntPhysics,
) -> Dataset:
    """Return the training pairs of one experiment."""
    model = solver_on(grid).model(learnt)
    return build_dataset(
        [frames],
        rig,
        grid=grid,
        time_step=time_step,
        predict=model.predict,
        residual=model.residual,
        preset=preset,
    )


@dataclass(frozen=True)
class TrainingChoice:
    """How to train.

    Attributes:
        architecture: the network; it says whether physics is learnt first.
        seed: of weights, samples and roll-outs.
        epochs: passes over the single steps; 0: as suits the network. Fewer passes than usual
            shorten the roll-outs in proportion.
        curriculum: stages of the roll-outs; empty: single steps only.
    """

    architecture: Architecture
    seed: int
    epochs: int = 0
    curriculum: Sequence[Stage] = CURRICULUM


def train_from_runs(
    experiments: Experiments,
    choice: TrainingChoice,
    *,
    progress: ProgressFn = lambda _: None,
    say: SayFn = lambda _: None,
) -> CorrectiveModel:
    """Return a model trained on single steps and then through free runs, and judged by free runs.

    Args:
        experiments: the maps and the model to correct.
        choice: how to train.
        progress: called after every epoch.
        say: told every decision.

    Raises:
        InputError: too few maps, none with tracer to judge, the model cannot run, or the rig has
            levels.
    """
    refuse_untaught(experiments.rig)
    architecture = choice.architecture
    usual = architecture.training.epochs
    settings = architecture.training.with_epochs(choice.epochs)
    learning, kept = kept_runs(experiments.frames, settings.validation_share)
    if not kept:
        raise InputError('no free run can be judged: give three consecutive maps at least')
    solver = experiments.solver_on(experiments.grid)
    judge = Judge(solver, kept, experiments.time_step)
    judge.check()
    alone = float(judge.alone.mean())
    say(f'model alone: error of the kept free runs {alone:.4f} of the observed maps')
    learnt = LearntPhysics()
    if architecture.learns_physics:
        found = tuple(experiments.missing(learning, say))
        learnt = _learnt(found, experiments.sharper, judge, say)
    dataset = experiments.pairs(experiments.frames, learnt)
    model = train(dataset, architecture, settings, seed=choice.seed, progress=progress)
    if learnt != NO_LEARNT_PHYSICS:
        model = replace(model, learnt=learnt)
    model = train_through_runs(
        model,
        solver.model(learnt),
        learning,
        lambda one: judge.errors(one).mean_corrected,
        seed=choice.seed,
        curriculum=[stage.shortened(settings.epochs / usual) for stage in choice.curriculum],
        say=say,
    )
    model = gated(model, judge)
    say(model.provenance['gate']['says'])
    return model


def _learnt(
    effects: tuple[EffectDescription, ...], sharper: str, judge: Judge, say: SayFn
) -> LearntPhysics:
    """Return `effects` and the scheme `sharper`, each if kept runs gain enough by it.

    The effects are judged with that scheme: the error of a coarse one may hide them.
    """
    known = LearntPhysics(scheme=sharper)
    error = judge.physics_error(known)
    if effects:
        more = replace(known, effects=effects)
        after = judge.physics_error(more)
        if _gains('the physics found', error, after, 0.0, say):
            known, error = more, after
    coarse = replace(known, scheme='')
    if not sharper:
        return coarse
    before = judge.physics_error(coarse)
    return known if _gains(f'scheme {sharper}', before, error, SCHEME_GAIN, say) else coarse


def _gains(name: str, before: float, after: float, share: float, say: SayFn) -> bool:
    """Return whether an error falls so that more than a `share` of its square is gone."""
    gains = after**2 < (1.0 - share) * before**2
    say(
        f'{name} {"taken" if gains else "not needed"}: error of the kept free runs {after:.4f} '
        f'instead of {before:.4f}'
    )
    return gains
