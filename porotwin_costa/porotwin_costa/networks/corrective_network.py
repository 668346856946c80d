"""The interface between COSTA and a network."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, NamedTuple, Self

import torch
from torch import Tensor, nn

from porotwin_core.geometry.grid import FloatArray
from porotwin_costa.data.flow_shape import FlowShape
from porotwin_costa.networks.training_settings import TrainingSettings

TRACER_PRESENT = 0.02
"""Smallest concentration of a cell with tracer [-]; above the camera's noise."""

RATES_PER_WELL = 2
"""A well is described by its water rate and its tracer rate (water rate times concentration)."""


class Window(NamedTuple):
    """A part of the grid: `nz` x `nx` cells, the lower left one in row `z` and column `x`."""

    z: int
    x: int
    nz: int
    nx: int

    def cells(self, field: Tensor) -> Tensor:
        """Return the window of a cell field (..., nz, nx)."""
        return field[..., self.z : self.z + self.nz, self.x : self.x + self.nx]

    def right_faces(self, field: Tensor) -> Tensor:
        """Return the inner faces between columns, of a field (..., nz, nx - 1)."""
        return field[..., self.z : self.z + self.nz, self.x : self.x + self.nx - 1]

    def up_faces(self, field: Tensor) -> Tensor:
        """Return the inner faces between rows, of a field (..., nz - 1, nx)."""
        return field[..., self.z : self.z + self.nz - 1, self.x : self.x + self.nx]


@dataclass(frozen=True)
class RigFields:
    """The rig, grid and time step as a network may use them.

    `shape` is (nz, nx) of the grid, `wells` the number of wells, `flow` the flow of each well
    through homogeneous sand. `change_per_sigma` (nz, nx) is the change of concentration [-] that
    one unit of scaled sigma makes in a time step, `relative_depth` (nz, nx) the depth of the rig
    divided by its mean [-].
    """

    shape: tuple[int, int]
    wells: int
    flow: FlowShape
    change_per_sigma: FloatArray
    relative_depth: FloatArray


class CorrectiveNetwork(nn.Module):
    """Base class of the networks: from a scaled prediction and scaled rates to scaled sigma."""

    def forward(self, concentration: Tensor, rates: Tensor) -> Tensor:
        """Return scaled sigma (batch, nz, nx); every network defines it.

        `concentration` is the scaled prediction c~ (batch, nz, nx); `rates` (batch, 2 wells) holds
        the scaled water rate and tracer rate of each well in turn.
        """
        raise NotImplementedError

    def forward_windows(
        self, concentration: Tensor, rates: Tensor, windows: Sequence[Window]
    ) -> Tensor:
        """Return scaled sigma on one window of each sample, (batch, window nz, window nx).

        Needed for training on windows. This version passes the window of the prediction to
        `forward`, which is right for a network that uses no other field.
        """
        samples = zip(concentration, windows, strict=True)
        return self(torch.stack([window.cells(sample) for sample, window in samples]), rates)


@dataclass(frozen=True)
class Architecture:
    """A network that COSTA can train, with all its particulars.

    `name` selects it, `summary` is one line for a person. `build` makes the network with fresh
    weights from `settings`, a frozen dataclass of JSON values, and the rig. `training` are the
    settings that suit it.

    With `standardise`, its input has zero mean and unit variance; without, the network gets the
    concentration itself. `reach` [cells] is the largest distance over which the prediction
    influences sigma; None if each value of sigma depends on the whole map. Only a network with a
    reach can be trained on windows. For a network without one, the mean concentration and the rate
    of each well must lie within the training range (`gate.TrainingRange`).

    With `learns_physics`, effects of the physics are learnt before the network, which then corrects
    the remainder (`run_training`).
    """

    name: str
    summary: str
    build: Callable[[Any, RigFields], CorrectiveNetwork]
    settings: Any
    training: TrainingSettings
    standardise: bool = True
    reach: int | None = None
    learns_physics: bool = False

    def network(self, rig: RigFields) -> CorrectiveNetwork:
        """Return the network for a rig, with fresh weights."""
        return self.build(self.settings, rig)

    def description(self) -> dict[str, Any]:
        """Return name and settings as JSON values, for a model file."""
        return {'architecture': self.name, **asdict(self.settings)}

    def described(self, values: Mapping[str, Any]) -> Self:
        """Return this architecture with the settings in `values`; absent ones keep their default.

        Other keys are ignored: files of version 0.1 list the layers of the paper's network for
        every architecture.
        """
        known = {field.name for field in fields(self.settings)}
        chosen = {name: value for name, value in values.items() if name in known}
        return replace(self, settings=replace(self.settings, **chosen))


def parameter_count(network: nn.Module) -> int:
    """Return the number of weights that training adjusts."""
    return sum(parameter.numel() for parameter in network.parameters())
