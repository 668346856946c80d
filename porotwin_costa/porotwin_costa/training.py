"""Training: repeatable from a seed, judged on samples that it does not learn from."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from porotwin_core.errors import InputError
from porotwin_costa.batches import Batches
from porotwin_costa.dataset import Dataset
from porotwin_costa.gate import TrainingRange
from porotwin_costa.model import CorrectiveModel
from porotwin_costa.network import (
    HOMOGENEOUS_RIG,
    LocalFluxNetwork,
    NetworkSettings,
    build_network,
    parameter_count,
)
from porotwin_costa.scaling import Scaling


@dataclass(frozen=True)
class TrainingSettings:
    """How long and on what to train.

    About `validation_share` of the samples is kept aside, see `split_samples`. Training ends after
    `patience` epochs without a better loss on those, and the best weights are kept. The local
    network learns from windows of `window` x `window` cells, or from whole maps with 0.
    """

    network: NetworkSettings = HOMOGENEOUS_RIG
    epochs: int = 150
    batch_size: int = 16
    learning_rate: float = 1e-3
    patience: int = 40
    window: int = 0
    validation_share: float = 0.15

    def __post_init__(self) -> None:
        if min(self.epochs, self.batch_size, self.patience) < 1 or not self.learning_rate > 0:
            raise InputError(
                f'training: epochs {self.epochs}, batch_size {self.batch_size}, patience '
                f'{self.patience}, learning_rate {self.learning_rate} must all be positive'
            )
        if not 0 < self.validation_share < 1:
            raise InputError(f'validation_share {self.validation_share}: must lie within 0 and 1')


@dataclass(frozen=True)
class TrainingProgress:
    """State after an epoch; losses are mean squared errors relative to the residual's own [-].

    A validation loss of 1 is that of no correction at all; a training loss over windows counts only
    where tracer is, so it is larger.
    """

    epoch: int
    epochs: int
    training_loss: float
    validation_loss: float
    remaining_seconds: float


class TrainingCancelledError(Exception):
    """Training was asked to stop before it was done; there is no model."""


def split_samples(dataset: Dataset, settings: TrainingSettings) -> NDArray[np.bool_]:
    """Return which samples are kept aside for validation, shape (samples,).

    The last experiments, whole: a frame that follows one learned from is hardly a new one. As many
    as hold `validation_share` of the samples, but at most half of all; where that cannot be, as
    with one experiment, the last samples of all.

    Raises:
        InputError: too few samples to keep any aside.
    """
    count = len(dataset)
    if count < 4:
        raise InputError(f'{count} training pairs: at least 4 are needed; record longer')
    wanted = settings.validation_share * count
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


def train(
    dataset: Dataset,
    settings: TrainingSettings,
    *,
    seed: int,
    progress: Callable[[TrainingProgress], None] = lambda _: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> CorrectiveModel:
    """Return a model of the residuals in `dataset`: mean squared error, Adam, early stopping.

    The same data, settings, seed and number of threads give the same weights, bit for bit.
    `progress` is called after every epoch, `cancelled` is asked after every batch.

    Raises:
        InputError: too little to learn from, or no epoch with a finite loss.
        TrainingCancelledError: `cancelled` said so.
    """
    aside = split_samples(dataset, settings)
    learning, judging = dataset.select(~aside), dataset.select(aside)
    scaling = Scaling.of(learning, settings.network)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = build_network(
            dataset.grid.shape, len(dataset.wells), settings.network, dataset.flow
        )
    if isinstance(network, LocalFluxNetwork):
        network.change.copy_(torch.as_tensor(scaling.sigma * dataset.time_step / dataset.porosity))
        network.relative_depth.copy_(torch.as_tensor(dataset.relative_depth))
    batches, validation = Batches.of(learning, scaling), Batches.of(judging, scaling)
    losses = _fit(
        network, batches, validation, settings, seed=seed, progress=progress, cancelled=cancelled
    )
    answer = validation.answers(network, settings.batch_size)
    trust, unexplained = _trust(answer, validation.target)
    return CorrectiveModel(
        grid=dataset.grid,
        wells=dataset.wells,
        time_step=dataset.time_step,
        settings=settings.network,
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
            'settings': asdict(settings),
            'parameters': parameter_count(network),
            'training_loss': losses[0],
            'validation_loss': losses[1],
            'unexplained_share': unexplained,
            'epochs': losses[2],
            'versions': {name: version(name) for name in ('torch', 'numpy')},
        },
    )


def _trust(answer: Tensor, target: Tensor) -> tuple[float, float]:
    """Return the factor in 0..1 that fits the answer to the target best, and what it leaves.

    Least squares through the origin; what is left is the share of the target's sum of squares.
    """
    power = float((answer.double() ** 2).sum())
    fit = float((answer.double() * target.double()).sum()) / power if power > 0 else 0.0
    trust = min(max(fit, 0.0), 1.0)
    total = float((target.double() ** 2).sum())
    left = float(((trust * answer.double() - target.double()) ** 2).sum())
    return trust, left / total if total > 0 else 0.0


def _fit(
    network: nn.Module,
    batches: Batches,
    validation: Batches,
    settings: TrainingSettings,
    *,
    seed: int,
    progress: Callable[[TrainingProgress], None],
    cancelled: Callable[[], bool],
) -> tuple[float, float, int]:
    """Train in place; return the losses of the weights kept and the number of epochs done."""
    random = torch.Generator().manual_seed(seed)
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.epochs)
    best, best_weights, since = (np.inf, np.inf, 0), {}, 0
    started = time.monotonic()
    count = len(batches.target)
    for epoch in range(1, settings.epochs + 1):
        network.train()
        total = 0.0
        for chosen in torch.randperm(count, generator=random).split(settings.batch_size):
            if cancelled():
                raise TrainingCancelledError(f'stopped in epoch {epoch}')
            optimiser.zero_grad()
            if settings.window and isinstance(network, LocalFluxNetwork):
                loss = batches.window_loss(network, chosen, settings.window, random)
            else:
                loss = batches.loss(network, chosen)
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(chosen)
        schedule.step()
        network.eval()
        answer = validation.answers(network, settings.batch_size)
        loss_aside = float(nn.functional.mse_loss(answer, validation.target))
        loss_aside /= float(validation.target.square().mean()) or 1.0
        since += 1
        if loss_aside < best[1]:
            best, since = (total / count, loss_aside, epoch), 0
            best_weights = {name: value.clone() for name, value in network.state_dict().items()}
        remaining = (time.monotonic() - started) / epoch * (settings.epochs - epoch)
        progress(TrainingProgress(epoch, settings.epochs, total / count, loss_aside, remaining))
        if since >= settings.patience:
            break
    if not best_weights:
        raise InputError(
            f'training diverged with learning_rate {settings.learning_rate}; try a tenth of it'
        )
    network.load_state_dict(best_weights)
    return best[0], best[1], epoch
