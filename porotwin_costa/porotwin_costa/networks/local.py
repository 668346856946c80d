"""A network of fluxes between neighbouring cells: it only moves tracer, and learns from little."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_costa.networks.corrective_network import (
    RATES_PER_WELL,
    TRACER_PRESENT,
    Architecture,
    CorrectiveNetwork,
    RigFields,
    Window,
)
from porotwin_costa.networks.training_settings import TrainingSettings

pad = nn.functional.pad

TYPICAL_FLOW = 0.02
"""Share of a well's rate that crosses a face ten cells away [-]: 1 / (2 pi 10), rounded up."""

BASE_FLOW = 0.1 * TYPICAL_FLOW
"""q0: lets the network learn fluxes that do not follow the flow, such as diffusion [-]."""


REACH = 6
"""Largest distance over which c~ influences sigma [cells]: kernels of 5, 3, 3, 3 and one face.

The flux limiter adds a weak influence of one more cell, which training on windows neglects.
"""


@dataclass(frozen=True)
class LocalFluxSettings:
    """`filters` is the number of channels of the inner convolutions.

    Raises:
        InputError: there is no filter.
    """

    filters: int = 16

    def __post_init__(self) -> None:
        if self.filters < 1:
            raise InputError(f'{self}: filters must be at least 1')


class LocalFluxNetwork(CorrectiveNetwork):
    """sigma = -div F / d with a learned flux F through each face; everything is scaled.

    d is the depth of the rig relative to its mean, because sigma is a density per rig volume.

    F = (|q| + q0) m N. q is the flow through the face in homogeneous sand, superposed from the
    rates (`FlowShape`); q0 is `BASE_FLOW`. m falls to zero where neither cell holds tracer. N is a
    small convolutional network of c~ and q around the face. A transport scheme errs in the
    concentration that it carries across a face, so N has the meaning of a concentration, as in
    learned discretisations (Zhuang et al., Phys. Rev. Fluids 6, 064605, 2021).

    The correction is zero where there is no tracer. It conserves tracer, makes no new extremum
    (`_limited`) and does not depend on the place in the rig. For the same reasons it cannot correct
    for tracer that was injected or lost unnoticed.

    Its buffers: `right_flow` (wells, nz, nx - 1) and `up_flow` (wells, nz - 1, nx) of `FlowShape`,
    `change` and `relative_depth` (nz, nx) of `RigFields`.
    """

    right_flow: Tensor
    up_flow: Tensor
    change: Tensor
    relative_depth: Tensor

    def __init__(self, settings: LocalFluxSettings, rig: RigFields) -> None:
        """Keep the fields of `rig` and make the layers with random weights."""
        super().__init__()
        self.shape = rig.shape
        for name, field in (
            ('right_flow', rig.flow.right),
            ('up_flow', rig.flow.up),
            ('change', rig.change_per_sigma),
            ('relative_depth', rig.relative_depth),
        ):
            self.register_buffer(name, torch.as_tensor(field, dtype=torch.float32))
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
        self.register_load_state_dict_pre_hook(_assume_even_depth)

    def forward(self, concentration: Tensor, rates: Tensor) -> Tensor:
        """Return scaled sigma (batch, nz, nx) of c~ (batch, nz, nx) and rates (batch, 2 w)."""
        flow = self.face_flow(rates)
        return self.source(concentration, *flow, self.change, self.relative_depth)

    def forward_windows(
        self, concentration: Tensor, rates: Tensor, windows: Sequence[Window]
    ) -> Tensor:
        """Return scaled sigma on one window of each sample, with the flow of the whole rig.

        Shapes are those of `CorrectiveNetwork.forward_windows`.
        """
        right, up = self.face_flow(rates)
        inputs = [
            (
                window.cells(concentration[sample]),
                window.right_faces(right[sample]),
                window.up_faces(up[sample]),
                window.cells(self.change),
                window.cells(self.relative_depth),
            )
            for sample, window in enumerate(windows)
        ]
        return self.source(*(torch.stack(fields) for fields in zip(*inputs, strict=True)))

    def face_flow(self, rates: Tensor) -> tuple[Tensor, Tensor]:
        """Return the flow to the right and upward through the inner faces, in scaled rates.

        From `rates` (batch, 2 wells) to (batch, nz, nx - 1) and (batch, nz - 1, nx).
        """
        water = rates.view(len(rates), -1, RATES_PER_WELL)[..., 0]
        return (
            torch.einsum('bw,wzx->bzx', water, self.right_flow),
            torch.einsum('bw,wzx->bzx', water, self.up_flow),
        )

    def source(
        self, concentration: Tensor, right: Tensor, up: Tensor, change: Tensor, depth: Tensor
    ) -> Tensor:
        """Return scaled sigma of c~ and the flow through the inner faces, on the grid or a window.

        `concentration` is (batch, nz, nx), the flow `right` (batch, nz, nx - 1) and `up`
        (batch, nz - 1, nx). `change` is the change of concentration per unit of scaled sigma,
        `depth` the depth relative to the rig's mean, both (nz, nx) or (batch, nz, nx).
        """
        across = 0.5 * (pad(right, (0, 1)) + pad(right, (1, 0)))
        along = 0.5 * (pad(up, (0, 0, 0, 1)) + pad(up, (0, 0, 1, 0)))
        factor = self.trunk(
            torch.stack([concentration, _compressed(across), _compressed(along)], dim=1)
        )
        right_tracer = concentration[:, :, 1:] + concentration[:, :, :-1]
        up_tracer = concentration[:, 1:] + concentration[:, :-1]
        fluxes = (
            _flux(0.5 * (factor[:, 0, :, :-1] + factor[:, 0, :, 1:]), right, right_tracer),
            _flux(0.5 * (factor[:, 1, :-1] + factor[:, 1, 1:]), up, up_tracer),
        )
        return -_outflow(*_limited(concentration, *fluxes, change / depth)) / depth


def _flux(factor: Tensor, flow: Tensor, tracer: Tensor) -> Tensor:
    """Return F = (|q| + q0) m N on faces; `tracer` is the sum over the two cells of a face."""
    presence = torch.clamp(tracer / (2 * TRACER_PRESENT), 0.0, 1.0)
    return (flow.abs() + BASE_FLOW) * presence * factor


def _outflow(right: Tensor, up: Tensor) -> Tensor:
    """Return the sum of the fluxes out of each cell; nothing passes the rig's edges."""
    return pad(right, (0, 1)) - pad(right, (1, 0)) + pad(up, (0, 0, 0, 1)) - pad(up, (0, 0, 1, 0))


def _limited(
    concentration: Tensor, right: Tensor, up: Tensor, change: Tensor
) -> tuple[Tensor, Tensor]:
    """Return the fluxes, reduced where they would make a new extremum among neighbours.

    Flux-corrected transport (Zalesak, J. Comput. Phys. 31:335, 1979). `change` is the change of
    concentration per unit of outflow. Each face takes the smaller of the shares that its two cells
    allow.
    """
    pool = nn.functional.max_pool2d
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
    gain_share = torch.clamp(
        (highest - concentration + SMALLEST_DIVISOR) / (gain + SMALLEST_DIVISOR), max=1.0
    )
    loss_share = torch.clamp(
        (concentration - lowest + SMALLEST_DIVISOR) / (loss + SMALLEST_DIVISOR), max=1.0
    )
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


def _compressed(flow: Tensor) -> Tensor:
    """Return asinh(q / typical q), so that the large flow at a well does not hide the rest."""
    return torch.asinh(flow / TYPICAL_FLOW)


def _assume_even_depth(
    module: LocalFluxNetwork, weights: dict[str, Any], prefix: str, *_: object
) -> None:
    """Add the depth to the weights of a file of version 0.1, which took it for even."""
    weights.setdefault(f'{prefix}relative_depth', torch.ones(module.shape))


ARCHITECTURE = Architecture(
    name='local',
    summary='fluxes between neighbouring cells; learns from few experiments',
    build=LocalFluxNetwork,
    settings=LocalFluxSettings(),
    # a window of 32 cells leaves 20 x 20 cells inside the reach; small batches suit few experiments
    training=TrainingSettings(epochs=30, batch_size=4, learning_rate=3e-3, patience=15, window=32),
    standardise=False,
    reach=REACH,
)
