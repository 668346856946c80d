"""Training of a network: repeatable from a seed, validated on samples kept aside."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.basis.errors import InputError
from porotwin_costa.correction.corrective_model import CorrectiveModel
from porotwin_costa.correction.gate import TrainingRange
from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.scaling import Scaling
from porotwin_costa.networks import Architecture, CorrectiveNetwork, RigFields, parameter_count
from porotwin_costa.networks.training_settings import TrainingSettings
from porotwin_costa.training.batches import Batches
from porotwin_costa.training.data_parallel import own_part, sum_gradients

LEAST_PAIRS = 4
"""Fewer pairs cannot be split into training and validation samples."""


@dataclass(frozen=True)
class TrainingProgress:
    """State after an epoch; losses [-] are mean squared errors over the mean squared residual.

    The validation loss without any correction is 1. The training loss over windows is larger,
    because it counts only cells near tracer. `remaining_seconds` is an estimate [s].
    """

    epoch: int
    epochs: int
    training_loss: float
    validation_loss: float
    remaining_seconds: float


ProgressFn = Callable[[TrainingProgress], None]
"""Called after every epoch."""


class TrainingCancelledError(Exception):
    """Training was cancelled; there is no model."""


class Losses(NamedTuple):
    """Losses [-] of the weights that are kept, and the number of epochs; see `TrainingProgress`."""

    training: float
    validation: float
    epochs: int


def split_samples(dataset: Dataset, validation_share: float) -> NDArray[np.bool_]:
    """Return which samples are kept for validation, shape (samples,).

    They are the last experiments as a whole, because consecutive frames of one experiment are
    nearly the same. Together they hold at least `validation_share` of the samples, but no more than
    half. Where that is impossible, as with one experiment, the last samples are taken.

    Raises:
        InputError: there are fewer than `LEAST_PAIRS` samples.
    """
    count = len(dataset)
    if count < LEAST_PAIRS:
        raise InputError(
            f'{count} training pairs: at least {LEAST_PAIRS} are needed; record longer'
        )
    wanted = validation_share * count
    for number in np.unique(dataset.experiment)[::-1]:
        aside = dataset.experiment >= number
        if aside.sum() >= wanted:
            break
    if 2 * aside.sum() <= count:
        return aside
    aside = np.zeros(count, bool)
    in_order = np.lexsort((dataset.time, dataset.experiment))
    aside[in_order[-max(1, round(wanted)) :]] = True
    return aside


@one_blas_thread()
def train(
    dataset: Dataset,
    architecture: Architecture,
    settings: TrainingSettings | None = None,
    *,
    seed: int,
    progress: ProgressFn = lambda _: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> CorrectiveModel:
    """Return a model of the residuals in `dataset`: mean squared error, Adam, early stopping.

    The same data, settings, seed and number of threads give the same weights, bit for bit.

    Args:
        dataset: predictions, rates and residuals.
        architecture: the network to train.
        settings: how to train; None: the settings of the architecture.
        seed: of the first weights and of the order of the samples.
        progress: called after every epoch.
        cancelled: asked before every batch; True ends the training.

    Raises:
        InputError: too few samples, windows for a network that reads the whole map, or no epoch
            with a finite loss.
        TrainingCancelledError: `cancelled` returned True.
    """
    settings = settings or architecture.training
    if settings.window and architecture.reach is None:
        raise InputError(
            f"architecture '{architecture.name}': reads the whole map; train it with window 0"
        )
    aside = split_samples(dataset, settings.validation_share)
    learning, judging = dataset.select(~aside), dataset.select(aside)
    scaling = Scaling.of(learning, standardise=architecture.standardise)
    network = _fresh_network(dataset, architecture, scaling, seed)
    batches, validation = Batches.of(learning, scaling), Batches.of(judging, scaling)
    loop = _Loop(network, batches, validation, settings, architecture.reach or 0)
    losses = loop.run(seed=seed, progress=progress, cancelled=cancelled)
    answer = validation.answers(network, settings.batch_size)
    trust, unexplained = _trust(answer, validation.target)
    return CorrectiveModel(
        grid=dataset.grid,
        wells=dataset.wells,
        time_step=dataset.time_step,
        architecture=architecture,
        network=network.eval(),
        scaling=scaling,
        trained_on=TrainingRange.of(dataset.predicted, dataset.rates, dataset.residual),
        trust=trust,
        physics=dataset.physics,
        provenance={
            'data': dataset.fingerprint,
            'samples': len(dataset),
            'sources': list(dataset.sources),
            'seed': seed,
            'settings': {'network': architecture.description(), **asdict(settings)},
            'parameters': parameter_count(network),
            'training_loss': losses.training,
            'validation_loss': losses.validation,
            'unexplained_share': unexplained,
            'epochs': losses.epochs,
            'versions': {name: version(name) for name in ('torch', 'numpy')},
        },
    )


def _fresh_network(
    dataset: Dataset, architecture: Architecture, scaling: Scaling, seed: int
) -> CorrectiveNetwork:
    """Return the network with random weights from `seed`; the global random state is kept."""
    rig = RigFields(
        shape=dataset.grid.shape,
        wells=len(dataset.wells),
        flow=dataset.flow,
        change_per_sigma=scaling.sigma * dataset.time_step / dataset.porosity,
        relative_depth=dataset.relative_depth,
    )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return architecture.network(rig)


def _trust(answer: Tensor, target: Tensor) -> tuple[float, float]:
    """Return the factor in 0..1 that fits the answer to the target, and the unexplained share.

    The factor is the least-squares solution through the origin. The unexplained share is
    |factor * answer - target|^2 / |target|^2.
    """
    power = float((answer.double() ** 2).sum())
    fit = float((answer.double() * target.double()).sum()) / power if power > 0 else 0.0
    trust = min(max(fit, 0.0), 1.0)
    total = float((target.double() ** 2).sum())
    remainder = float(((trust * answer.double() - target.double()) ** 2).sum())
    return trust, remainder / total if total > 0 else 0.0


@dataclass(frozen=True)
class _Loop:
    """The training loop; it leaves the best weights in `network`."""

    network: CorrectiveNetwork
    batches: Batches
    validation: Batches
    settings: TrainingSettings
    reach: int

    def run(self, *, seed: int, progress: ProgressFn, cancelled: Callable[[], bool]) -> Losses:
        network, settings = self.network, self.settings
        random = torch.Generator().manual_seed(seed)
        optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.epochs)
        best, best_weights, epochs_since = Losses(np.inf, np.inf, 0), {}, 0
        started = time.monotonic()
        for epoch in range(1, settings.epochs + 1):
            training_loss = self._epoch(optimiser, random, epoch, cancelled)
            schedule.step()
            validation_loss = self._validation_loss()
            epochs_since += 1
            if validation_loss < best.validation:
                best, epochs_since = Losses(training_loss, validation_loss, epoch), 0
                best_weights = {name: value.clone() for name, value in network.state_dict().items()}
            remaining = (time.monotonic() - started) / epoch * (settings.epochs - epoch)
            progress(
                TrainingProgress(epoch, settings.epochs, training_loss, validation_loss, remaining)
            )
            if epochs_since >= settings.patience:
                break
        if not best_weights:
            raise InputError(
                f'training diverged with learning_rate {settings.learning_rate}; try a tenth of it'
            )
        network.load_state_dict(best_weights)
        return best._replace(epochs=epoch)

    def _epoch(
        self,
        optimiser: torch.optim.Optimizer,
        random: torch.Generator,
        epoch: int,
        cancelled: Callable[[], bool],
    ) -> float:
        """Train on every sample once, in random order; return the mean loss."""
        self.network.train()
        total = 0.0
        count = len(self.batches.target)
        for chosen in torch.randperm(count, generator=random).split(self.settings.batch_size):
            if cancelled():
                raise TrainingCancelledError(f'stopped in epoch {epoch}')
            optimiser.zero_grad()
            total += self._add_gradient(chosen, random) * len(chosen)
            sum_gradients(self.network.parameters())
            optimiser.step()
        return total / count

    def _add_gradient(self, chosen: Tensor, random: torch.Generator) -> float:
        """Add the gradient by the samples of this process; return their share of the mean loss."""
        size, own = self.settings.window, own_part(chosen)
        windows = self.batches.windows(chosen, size, random) if size else []
        if not len(own):
            return 0.0
        if size:
            drawn = [windows[place] for place in own.tolist()]
            loss = self.batches.window_loss(self.network, chosen[own], drawn, reach=self.reach)
        else:
            loss = self.batches.loss(self.network, chosen[own])
        loss = loss * (len(own) / len(chosen))
        loss.backward()
        return float(loss.detach())

    def _validation_loss(self) -> float:
        """Return the mean squared error on the validation samples, relative to no correction."""
        self.network.eval()
        answer = self.validation.answers(self.network, self.settings.batch_size)
        loss = float(nn.functional.mse_loss(answer, self.validation.target))
        return loss / (float(self.validation.target.square().mean()) or 1.0)
