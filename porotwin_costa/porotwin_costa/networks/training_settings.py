"""Settings of a training: its length, step size and samples."""

from dataclasses import dataclass, replace
from typing import Self

from porotwin_core.basis.errors import InputError


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of one training.

    `epochs` is the largest number of passes over the data. Training stops earlier after `patience`
    epochs without a smaller validation loss. `batch_size` counts samples, `learning_rate` is the
    first step size of Adam. With `window` > 0 the network learns from windows of `window` x
    `window` cells; with 0 from whole maps. `validation_share` of the samples is kept for validation
    (`training.split_samples`).

    Raises:
        InputError: a number is outside its range.
    """

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
        if self.window < 0:
            raise InputError(f'window {self.window}: give a number of cells, or 0 for whole maps')
        if not 0 < self.validation_share < 1:
            raise InputError(f'validation_share {self.validation_share}: must lie within 0 and 1')

    def with_epochs(self, epochs: int) -> Self:
        """Return these settings with another number of epochs; 0 keeps the number."""
        return replace(self, epochs=epochs) if epochs else self
