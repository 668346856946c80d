"""Scaled samples as tensors, and the windows of them that the local network learns from."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from porotwin_costa.dataset import Dataset
from porotwin_costa.network import LocalFluxNetwork
from porotwin_costa.scaling import Scaling

_RIM = 6
"""Cells at the edge of a window whose surroundings are cut off: the reach of the local network."""


@dataclass(frozen=True)
class Batches:
    """Network inputs and targets: (samples, nz, nx), (samples, 2 wells), (samples, nz, nx)."""

    concentration: Tensor
    rates: Tensor
    target: Tensor

    @classmethod
    def of(cls, dataset: Dataset, scaling: Scaling) -> Self:
        """Return the samples of a data set, scaled."""

        def tensor(values: NDArray) -> Tensor:
            return torch.as_tensor(np.asarray(values, dtype=np.float32))

        return cls(
            tensor((dataset.predicted - scaling.offset) / scaling.spread),
            tensor(dataset.rates / scaling.rate).flatten(1),
            tensor(dataset.residual / scaling.sigma),
        )

    def answers(self, network: nn.Module, size: int) -> Tensor:
        """Return what the network says to all samples, `size` at a time."""
        with torch.inference_mode():
            pieces = zip(self.concentration.split(size), self.rates.split(size), strict=True)
            return torch.cat([network(concentration, rates) for concentration, rates in pieces])

    def loss(self, network: nn.Module, chosen: Tensor) -> Tensor:
        """Return the mean squared error over whole maps of the chosen samples."""
        answer = network(self.concentration[chosen], self.rates[chosen])
        return nn.functional.mse_loss(answer, self.target[chosen])

    def window_loss(
        self, network: LocalFluxNetwork, chosen: Tensor, window: int, random: torch.Generator
    ) -> Tensor:
        """Return the mean squared error over one window, `window` cells wide, of each sample.

        Windows lie around cells drawn from those that hold tracer: elsewhere there is nothing to
        learn, and many small pieces teach more in the same time than few whole maps.
        """
        concentration, target = self.concentration[chosen], self.target[chosen]
        right, up = network.face_flow(self.rates[chosen])
        full = target.shape[1:]
        nz, nx = (min(window, size) for size in full)
        parts: list[tuple[Tensor, ...]] = []
        for sample in range(len(chosen)):
            z, x = _corner(concentration[sample], (nz, nx), random)
            rows, columns = slice(z, z + nz), slice(x, x + nx)
            parts.append(
                (
                    concentration[sample, rows, columns],
                    right[sample, rows, x : x + nx - 1],
                    up[sample, z : z + nz - 1, columns],
                    network.change[rows, columns],
                    network.relative_depth[rows, columns],
                    target[sample, rows, columns],
                )
            )
        *inputs, wanted = (torch.stack(part) for part in zip(*parts, strict=True))
        rows, columns = (
            slice(_RIM, -_RIM) if size > 3 * _RIM and size < whole else slice(None)
            for size, whole in zip((nz, nx), full, strict=True)
        )
        answer = network.source(*inputs)
        return nn.functional.mse_loss(answer[:, rows, columns], wanted[:, rows, columns])


def _corner(
    concentration: Tensor, shape: tuple[int, int], random: torch.Generator
) -> tuple[int, int]:
    """Return the lower left cell of a window around a cell drawn from those that hold tracer."""
    cells = torch.nonzero(concentration > LocalFluxNetwork.presence)
    if len(cells) == 0:
        cells = torch.zeros(1, 2, dtype=torch.int64)
    z, x = cells[torch.randint(len(cells), (1,), generator=random)[0]].tolist()
    nz, nx = concentration.shape
    return (
        min(max(z - shape[0] // 2, 0), nz - shape[0]),
        min(max(x - shape[1] // 2, 0), nx - shape[1]),
    )
