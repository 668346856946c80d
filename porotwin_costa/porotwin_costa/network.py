"""The networks that turn a predicted concentration and well rates into a corrective source term."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor, nn

from porotwin_core.errors import InputError
from porotwin_costa.flow_shape import FlowShape

Architecture = Literal['paper', 'local']

RATES_PER_WELL = 2
"""A well is described by its rate and by the tracer it brings (rate times concentration)."""


@dataclass(frozen=True)
class NetworkSettings:
    """Which network, and how large.

    `architecture` 'paper' is the network of the paper (fig. cnn); 'local' computes fluxes between
    neighbouring cells and is described at `LocalFluxNetwork`. The numbers of layers are those of
    the paper: `convolution_pool_layers` combine a 5x5 convolution with 2x2 max-pooling,
    `convolution_layers` are pure 5x5 convolutions, `dense_layers` have `dense_nodes` nodes each and
    see the well rates. The paper does not say how many filters it used: `filters`.
    """

    architecture: Architecture = 'paper'
    convolution_pool_layers: int = 5
    convolution_layers: int = 0
    dense_layers: int = 3
    dense_nodes: int = 100
    filters: int = 16

    def __post_init__(self) -> None:
        if self.architecture not in ('paper', 'local'):
            raise InputError(f"architecture '{self.architecture}': choose 'paper' or 'local'")
        counts = (self.convolution_pool_layers, self.convolution_layers)
        if min(counts) < 0 or min(self.dense_layers, self.dense_nodes, self.filters) < 1:
            raise InputError(
                f'{self}: layers cannot be negative; dense layers, nodes and filters: at least 1'
            )


HOMOGENEOUS_RIG = NetworkSettings()
"""Paper, section 3.1: five convolution + pooling layers, none pure, three dense."""

COMPLEX_RIG = NetworkSettings(convolution_pool_layers=2, convolution_layers=5, dense_layers=5)
"""Paper, section 3.2: two convolution + pooling layers, five pure, five dense."""

LOCAL = NetworkSettings(architecture='local')
"""Fluxes between neighbouring cells from their surroundings and the flow."""


class PaperNetwork(nn.Module):
    """The convolutional network of the paper (section 2.2.3): c~ and rates to sigma.

    ReLU after every layer but the last, which is linear and as large as the grid. The rates join in
    every dense layer. Pooling rounds up, so that no row or column of an odd grid is lost.
    """

    def __init__(self, shape: tuple[int, int], wells: int, settings: NetworkSettings) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        channels, (nz, nx) = 1, shape
        for number in range(settings.convolution_pool_layers + settings.convolution_layers):
            layers += [nn.Conv2d(channels, settings.filters, 5, padding=2), nn.ReLU()]
            channels = settings.filters
            if number < settings.convolution_pool_layers:
                layers.append(nn.MaxPool2d(2, ceil_mode=True))
                nz, nx = -(-nz // 2), -(-nx // 2)
        self.convolutions = nn.Sequential(*layers)
        rates = RATES_PER_WELL * wells
        widths = [channels * nz * nx, *[settings.dense_nodes] * settings.dense_layers]
        self.dense = nn.ModuleList(
            nn.Linear(width + rates, settings.dense_nodes) for width in widths[:-1]
        )
        self.output = nn.Linear(settings.dense_nodes, shape[0] * shape[1])
        self.shape = shape

    def forward(self, concentration: Tensor, rates: Tensor) -> Tensor:
        """Return scaled sigma (batch, nz, nx) of scaled c~ (batch, nz, nx), rates (batch, 2 w)."""
        hidden = self.convolutions(concentration[:, None]).flatten(1)
        for layer in self.dense:
            hidden = torch.relu(layer(torch.cat([hidden, rates], dim=1)))
        return self.output(hidden).view(-1, *self.shape)


def _outflow(right: Tensor, up: Tensor) -> Tensor:
    """Return what flows out of each cell; nothing passes the rig's edges."""
    pad = nn.functional.pad
    return pad(right, (0, 1)) - pad(right, (1, 0)) + pad(up, (0, 0, 0, 1)) - pad(up, (0, 0, 1, 0))


class LocalFluxNetwork(nn.Module):
    """A corrective source term that only moves tracer: sigma = -div F / d, F learned per face.

    d is the depth of the rig relative to its mean, since sigma is a density per rig volume.

    F = (|q| + q0) m N: q is the flow through the face in homogeneous sand (`FlowShape`, superposed
    with the rates), q0 a tenth of its usual size, so that errors which do not follow the flow can
    be learned too, m falls to zero where neither cell holds tracer, and N is a small convolutional
    network of c~ and q around the face. What a transport scheme gets wrong is the concentration
    that it carries across a face, so N has the meaning of a concentration; learned discretisations
    do the same (Zhuang et al., Phys. Rev. Fluids 6, 064605, 2021). By construction the correction
    is zero where there is no tracer, makes and destroys none, makes no new extremum (`_bounded`)
    and does not depend on where in the rig it was learned. For the same reasons it cannot make up
    for tracer that was injected or lost unnoticed.
    """

    right_flow: Tensor
    up_flow: Tensor
    change: Tensor
    relative_depth: Tensor

    presence = 0.02
    """Concentration from which on a face counts as carrying tracer [-]."""

    def __init__(self, shape: tuple[int, int], settings: NetworkSettings, flow: FlowShape) -> None:
        super().__init__()
        self.shape = shape
        self.register_buffer('right_flow', torch.as_tensor(flow.right, dtype=torch.float32))
        self.register_buffer('up_flow', torch.as_tensor(flow.up, dtype=torch.float32))
        self.register_buffer('change', torch.zeros(shape))
        self.register_buffer('relative_depth', torch.ones(shape))
        filters = settings.filters
        self.trunk = nn.Sequential(
            nn.Conv2d(3, filters, 5, padding=2),
            nn.ReLU(),
            nn.Conv2d(filters, filters, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(filters, filters, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(filters, 2, 3, padding=1),
        )

    def forward(self, concentration: Tensor, rates: Tensor) -> Tensor:
        """Return scaled sigma (batch, nz, nx) of c~ (batch, nz, nx) and rates (batch, 2 w)."""
        flow = self.face_flow(rates)
        return self.source(concentration, *flow, self.change, self.relative_depth)

    def face_flow(self, rates: Tensor) -> tuple[Tensor, Tensor]:
        """Return the flow to the right and upward through the inner faces, in scaled rates."""
        pumped = rates.view(len(rates), -1, RATES_PER_WELL)[..., 0]
        return (
            torch.einsum('bw,wzx->bzx', pumped, self.right_flow),
            torch.einsum('bw,wzx->bzx', pumped, self.up_flow),
        )

    def source(
        self, concentration: Tensor, right: Tensor, up: Tensor, change: Tensor, depth: Tensor
    ) -> Tensor:
        """Return scaled sigma of c~ and the flow through the inner faces, on the grid or a part.

        `change` is the change of concentration per unit of scaled sigma, `depth` relative to the
        rig's mean, both as (nz, nx) or per sample.
        """
        pad = nn.functional.pad
        across = 0.5 * (pad(right, (0, 1)) + pad(right, (1, 0)))
        along = 0.5 * (pad(up, (0, 0, 0, 1)) + pad(up, (0, 0, 1, 0)))
        carried = self.trunk(torch.stack([concentration, _calm(across), _calm(along)], dim=1))
        right_tracer = concentration[:, :, 1:] + concentration[:, :, :-1]
        up_tracer = concentration[:, 1:] + concentration[:, :-1]
        fluxes = (
            self._flux(0.5 * (carried[:, 0, :, :-1] + carried[:, 0, :, 1:]), right, right_tracer),
            self._flux(0.5 * (carried[:, 1, :-1] + carried[:, 1, 1:]), up, up_tracer),
        )
        return -_outflow(*_bounded(concentration, *fluxes, change / depth)) / depth

    def _flux(self, carried: Tensor, flow: Tensor, tracer: Tensor) -> Tensor:
        present = torch.clamp(tracer / (2 * self.presence), 0.0, 1.0)
        return (flow.abs() + 0.1 * _USUAL_FLOW) * present * carried


def _bounded(
    concentration: Tensor, right: Tensor, up: Tensor, change: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the fluxes scaled down where they would make a new extremum among neighbours.

    Flux-corrected transport (Zalesak, J. Comput. Phys. 31:335, 1979) with `change` as the change of
    concentration per unit of outflow; each face takes the smaller of what its two cells allow.
    """
    pad, pool = nn.functional.pad, nn.functional.max_pool2d
    highest = pool(concentration[:, None], 3, 1, 1)[:, 0]
    lowest = -pool(-concentration[:, None], 3, 1, 1)[:, 0]
    positive, negative = torch.relu, lambda flux: torch.relu(-flux)
    gain = change * (
        pad(positive(right), (1, 0))
        + pad(negative(right), (0, 1))
        + pad(positive(up), (0, 0, 1, 0))
        + pad(negative(up), (0, 0, 0, 1))
    )
    loss = change * (
        pad(negative(right), (1, 0))
        + pad(positive(right), (0, 1))
        + pad(negative(up), (0, 0, 1, 0))
        + pad(positive(up), (0, 0, 0, 1))
    )
    tiny = 1e-9
    gain_share = torch.clamp((highest - concentration + tiny) / (gain + tiny), max=1.0)
    loss_share = torch.clamp((concentration - lowest + tiny) / (loss + tiny), max=1.0)
    right_share = torch.where(
        right > 0,
        torch.minimum(gain_share[:, :, 1:], loss_share[:, :, :-1]),
        torch.minimum(gain_share[:, :, :-1], loss_share[:, :, 1:]),
    )
    up_share = torch.where(
        up > 0,
        torch.minimum(gain_share[:, 1:], loss_share[:, :-1]),
        torch.minimum(gain_share[:, :-1], loss_share[:, 1:]),
    )
    return right * right_share, up * up_share


_USUAL_FLOW = 0.02
"""Share of a well's rate that crosses a face some ten cells away [-]: 1 / (2 pi 10)."""


def _calm(flow: Tensor) -> Tensor:
    """Return the flow compressed, so that its pole at a well does not drown what lies around."""
    return torch.asinh(flow / _USUAL_FLOW)


def build_network(
    shape: tuple[int, int], wells: int, settings: NetworkSettings, flow: FlowShape | None = None
) -> nn.Module:
    """Return the network of `settings` for a grid of `shape` (nz, nx), with fresh weights.

    Raises:
        InputError: the local network is asked for without the flow of the wells.
    """
    if settings.architecture == 'paper':
        return PaperNetwork(shape, wells, settings)
    if flow is None:
        raise InputError("network 'local': needs the wells' flow; build the data set with a rig")
    return LocalFluxNetwork(shape, settings, flow)


def parameter_count(network: nn.Module) -> int:
    """Return how many numbers the training adjusts."""
    return int(np.sum([parameter.numel() for parameter in network.parameters()]))
