"""The convolutional network of the paper (section 2.2.3), with the layers of section 3.1."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from porotwin_core.basis.errors import InputError
from porotwin_costa.networks.corrective_network import (
    RATES_PER_WELL,
    Architecture,
    CorrectiveNetwork,
    RigFields,
)
from porotwin_costa.networks.training_settings import TrainingSettings

KERNEL_CELLS = 5
"""Side of the convolution kernels (paper, section 2.2.3)."""


@dataclass(frozen=True)
class PaperSettings:
    """Numbers of layers; by default as for the paper's homogeneous rig (section 3.1).

    `convolution_pool_layers` combine a 5 x 5 convolution with 2 x 2 max-pooling,
    `convolution_layers` are 5 x 5 convolutions alone. `dense_layers` have `dense_nodes` nodes each.
    `filters` is the number of channels of every convolution; the paper does not give it.

    Raises:
        InputError: a number of layers is negative, or one that must be positive is not.
    """

    convolution_pool_layers: int = 5
    convolution_layers: int = 0
    dense_layers: int = 3
    dense_nodes: int = 100
    filters: int = 16

    def __post_init__(self) -> None:
        counts = (self.convolution_pool_layers, self.convolution_layers)
        if min(counts) < 0 or min(self.dense_layers, self.dense_nodes, self.filters) < 1:
            raise InputError(
                f'{self}: layers cannot be negative; dense layers, nodes and filters: at least 1'
            )


class PaperNetwork(CorrectiveNetwork):
    """Convolutions of c~, then dense layers that also read the rates (paper, fig. cnn).

    ReLU follows every layer but the last one, which is linear and as large as the grid. Every dense
    layer reads the rates. Pooling rounds up, so that the last row and column of an odd grid count.
    """

    def __init__(self, settings: PaperSettings, rig: RigFields) -> None:
        """Make the layers for the grid and wells of `rig`, with random weights."""
        super().__init__()
        layers: list[nn.Module] = []
        channels, (nz, nx) = 1, rig.shape
        for number in range(settings.convolution_pool_layers + settings.convolution_layers):
            convolution = nn.Conv2d(
                channels, settings.filters, KERNEL_CELLS, padding=KERNEL_CELLS // 2
            )
            layers += [convolution, nn.ReLU()]
            channels = settings.filters
            if number < settings.convolution_pool_layers:
                layers.append(nn.MaxPool2d(2, ceil_mode=True))
                nz, nx = -(-nz // 2), -(-nx // 2)
        self.convolutions = nn.Sequential(*layers)
        rates = RATES_PER_WELL * rig.wells
        widths = [channels * nz * nx, *[settings.dense_nodes] * settings.dense_layers]
        self.dense = nn.ModuleList(
            nn.Linear(width + rates, settings.dense_nodes) for width in widths[:-1]
        )
        self.output = nn.Linear(settings.dense_nodes, rig.shape[0] * rig.shape[1])
        self.shape = rig.shape

    def forward(self, concentration: Tensor, rates: Tensor) -> Tensor:
        """Return scaled sigma (batch, nz, nx) of scaled c~ (batch, nz, nx), rates (batch, 2 w)."""
        hidden = self.convolutions(concentration[:, None]).flatten(1)
        for layer in self.dense:
            hidden = torch.relu(layer(torch.cat([hidden, rates], dim=1)))
        return self.output(hidden).view(-1, *self.shape)


ARCHITECTURE = Architecture(
    name='paper',
    summary='the network of the paper for a homogeneous rig (section 3.1)',
    build=PaperNetwork,
    settings=PaperSettings(),
    training=TrainingSettings(epochs=150, patience=40),
)
