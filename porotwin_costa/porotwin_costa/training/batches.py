"""Scaled samples as tensors, and their loss on whole maps or on windows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from porotwin_costa.data.dataset import Dataset
from porotwin_costa.data.scaling import Scaling
from porotwin_costa.networks import CorrectiveNetwork, Window
from porotwin_costa.networks.corrective_network import TRACER_PRESENT


@dataclass(frozen=True)
class Batches:
    """Scaled inputs and targets of a network, without units.

    `concentration` holds the predictions and `target` the residuals, both (samples, nz, nx);
    `rates` (samples, 2 wells) the water rate and tracer rate of each well.
    `tracer_present` is `TRACER_PRESENT` on the scale of the input.
    """

    concentration: Tensor
    rates: Tensor
    target: Tensor
    tracer_present: float = TRACER_PRESENT

    @classmethod
    def of(cls, dataset: Dataset, scaling: Scaling) -> Self:
        """Return the samples of a data set, scaled."""

        def tensor(values: NDArray) -> Tensor:
            return torch.as_tensor(np.asarray(values, dtype=np.float32))

        return cls(
            tensor(scaling.concentration(dataset.predicted)),
            tensor(dataset.rates / scaling.rate).flatten(1),
            tensor(dataset.residual / scaling.sigma),
            (TRACER_PRESENT - scaling.offset) / scaling.spread,
        )

    def answers(self, network: CorrectiveNetwork, size: int) -> Tensor:
        """Return scaled sigma of all samples (samples, nz, nx), computed `size` at a time."""
        with torch.inference_mode():
            pieces = zip(self.concentration.split(size), self.rates.split(size), strict=True)
            return torch.cat([network(concentration, rates) for concentration, rates in pieces])

    def loss(self, network: CorrectiveNetwork, chosen: Tensor) -> Tensor:
        """Return the mean squared error over the whole maps of the samples `chosen`, (batch,)."""
        answer = network(self.concentration[chosen], self.rates[chosen])
        return nn.functional.mse_loss(answer, self.target[chosen])

    def windows(self, chosen: Tensor, size: int, random: torch.Generator) -> list[Window]:
        """Return a window of `size` x `size` cells for each of the samples `chosen`, (batch,).

        The windows lie around random cells that hold tracer. Elsewhere there is nothing to learn,
        and many windows teach more in the same time than few whole maps.
        """
        nz, nx = (min(size, cells) for cells in self.target.shape[1:])
        return [self._window(sample, (nz, nx), random) for sample in self.concentration[chosen]]

    def window_loss(
        self, network: CorrectiveNetwork, chosen: Tensor, windows: Sequence[Window], *, reach: int
    ) -> Tensor:
        """Return the mean squared error over one of the `windows` for each sample `chosen`.

        The `reach` cells next to the rim of a window do not count, because the network does not see
        all that influences them. They count where the window is as wide as the grid, or too small
        to lose its rim.
        """
        target = self.target[chosen]
        answer = network.forward_windows(self.concentration[chosen], self.rates[chosen], windows)
        wanted = torch.stack(
            [window.cells(sample) for sample, window in zip(target, windows, strict=True)]
        )
        rows, columns = (
            slice(reach, -reach) if reach and 3 * reach < cells < whole else slice(None)
            for cells, whole in zip(wanted.shape[1:], target.shape[1:], strict=True)
        )
        return nn.functional.mse_loss(answer[:, rows, columns], wanted[:, rows, columns])

    def _window(
        self, concentration: Tensor, shape: tuple[int, int], random: torch.Generator
    ) -> Window:
        """Return a window of `shape` around a random cell that holds tracer, inside the grid."""
        cells = torch.nonzero(concentration > self.tracer_present)
        if len(cells) == 0:
            cells = torch.zeros(1, 2, dtype=torch.int64)
        z, x = cells[torch.randint(len(cells), (1,), generator=random)[0]].tolist()
        nz, nx = concentration.shape
        return Window(
            min(max(z - shape[0] // 2, 0), nz - shape[0]),
            min(max(x - shape[1] // 2, 0), nx - shape[1]),
            *shape,
        )
