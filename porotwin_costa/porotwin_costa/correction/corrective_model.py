"""A trained model: the weights of a network with all that is needed to use them, and its file."""

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import safetensors
import torch
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rig import Rig
from porotwin_core.ros.foreign_words import in_short
from porotwin_costa.correction.gate import TrainingRange
from porotwin_costa.data.flow_shape import FlowShape
from porotwin_costa.data.physics_id import PhysicsId
from porotwin_costa.data.scaling import Scaling
from porotwin_costa.data.tensor_files import read_tensors, write_tensors
from porotwin_costa.networks import Architecture, CorrectiveNetwork, RigFields, architecture

FORMAT = 'porotwin-costa-model-1'

_DAMAGED = (
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
    safetensors.SafetensorError,
)
"""Errors that the libraries raise for a description or for weights that no training wrote."""


def check_replaceable(path: Path) -> None:
    """Check that a model saved at `path` replaces nothing, or an older model.

    Raises:
        InputError: it would replace something else.
    """
    if not os.path.lexists(path):
        return
    try:
        read_tensors(path, FORMAT)
    except InputError:
        raise InputError(f'{path} holds no COSTA model; name a new file') from None


@dataclass(frozen=True)
class CorrectiveModel:
    """A network for one rig, grid and time step [s], which `corrective_source` evaluates.

    `trust` in 0..1 scales the output of the network. Training finds it by least squares on the
    validation samples; it is 0 if the network learned nothing of use. `provenance` records the
    training: fingerprint of the data, seed, versions, losses. `physics` identifies the
    physics-based model: another preset or rig description has other errors. `learnt` is the physics
    that was learnt before the network; None if there is none.
    """

    grid: Grid
    wells: tuple[str, ...]
    time_step: float
    architecture: Architecture
    network: CorrectiveNetwork
    scaling: Scaling
    trained_on: TrainingRange
    trust: float
    provenance: Mapping[str, Any]
    physics: PhysicsId = field(default_factory=PhysicsId)
    learnt: LearntPhysics | None = None

    @property
    def summary(self) -> str:
        """One line for a person: network, grid, training and trust."""
        made = self.provenance
        if gate := made.get('gate'):
            return f'{self.architecture.name} network on {self.grid}: {gate["says"]}'
        return (
            f'{self.architecture.name} network on {self.grid}, {made["samples"]} pairs, seed '
            f'{made["seed"]}, validation loss {made["validation_loss"]:.3f}, trust {self.trust:.2f}'
        )

    @property
    def doubt(self) -> str:
        """One line if the model does not say which physics it corrects, else an empty string."""
        if self.physics.known:
            return ''
        return 'model does not say which rig and preset it corrects: not checked; train it again'

    def for_wells(self, wells: tuple[str, ...], grid: Grid) -> Self:
        """Return this model if it fits the wells and the grid of a rig.

        Raises:
            InputError: the model was trained for other wells or another grid.
        """
        if set(wells) != set(self.wells):
            ours, theirs = ', '.join(self.wells), ', '.join(wells)
            raise InputError(f'model for wells {ours}: the rig has {theirs}; train again')
        if grid != self.grid:
            raise InputError(
                f'model for grid {self.grid} over {self.grid.width} x {self.grid.height} m: the '
                f'twin runs on {grid} over {grid.width} x {grid.height} m; train for it'
            )
        return self

    def for_physics(self, rig: Rig, grid: Grid, preset: str = '') -> Self:
        """Return this model if it corrects the physics of `rig` on `grid`.

        `preset` is the numerical scheme; it is not checked if empty.

        Raises:
            InputError: it was trained for other wells, another grid, preset or rig description.
        """
        self.for_wells(tuple(rig.wells), grid)
        if difference := self.physics.difference(PhysicsId.of(rig, preset)):
            remedy = 'use the one it was trained for'
            if self.physics.preset and preset and self.physics.preset != preset:
                remedy = f'run with --preset {self.physics.preset}'
            raise InputError(f'model corrects {difference}; {remedy}, or train again')
        return self

    def save(self, path: Path) -> None:
        """Write weights and description to one .safetensors file: the whole file or nothing.

        Raises:
            InputError: the file cannot be written, or holds something else.
        """
        check_replaceable(Path(path))
        tensors: dict[str, NDArray] = {
            name: tensor.numpy() for name, tensor in self.network.state_dict().items()
        }
        write_tensors(Path(path), tensors, FORMAT, self.description())

    def description(self) -> dict[str, Any]:
        """Return everything but the weights, as JSON values."""
        return {
            'grid': dataclasses.asdict(self.grid),
            'wells': list(self.wells),
            'time_step': self.time_step,
            'network': self.architecture.description(),
            'scaling': dataclasses.asdict(self.scaling),
            'trained_on': dataclasses.asdict(self.trained_on),
            'trust': self.trust,
            'physics': dataclasses.asdict(self.physics),
            'learnt': None if self.learnt is None else self.learnt.description(),
            'provenance': dict(self.provenance),
        }

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the model saved at `path`.

        Raises:
            InputError: no such file, a pickle, another format, an unknown architecture, weights
                that do not fit, or a number that no training leaves.
        """
        path = Path(path)
        header, weights = read_tensors(path, FORMAT)
        try:
            model = cls._described(header, weights)
            model._check_numbers()
        except InputError as error:
            raise InputError(f'{path}: {error}') from None
        except _DAMAGED as error:
            reason = in_short(str(error))
            raise InputError(f'{path}: damaged model ({reason}); train it again') from None
        return model

    @classmethod
    def _described(cls, header: Mapping[str, Any], weights: Mapping[str, NDArray]) -> Self:
        """Return the model with this description and these weights.

        Raises:
            InputError: the architecture is unknown, or there is no such grid.
            Exception: one of `_DAMAGED`.
        """
        grid = Grid(**header['grid'])
        wells = tuple(header['wells'])
        described = header['network']
        chosen = architecture(described['architecture']).described(described)
        network = chosen.network(_unknown_rig(grid, len(wells)))
        network.load_state_dict({name: torch.from_numpy(each) for name, each in weights.items()})
        network.eval()
        learnt = header.get('learnt')
        return cls(
            grid=grid,
            wells=wells,
            time_step=float(header['time_step']),
            architecture=chosen,
            network=network,
            scaling=Scaling(**header['scaling']),
            trained_on=TrainingRange.from_description(header['trained_on']),
            trust=float(header['trust']),
            provenance=header['provenance'],
            physics=PhysicsId(**header.get('physics', {})),
            learnt=LearntPhysics.from_description(learnt) if learnt else None,
        )

    def _check_numbers(self) -> None:
        """Check the numbers of a file: a wrong one would make every correction wrong.

        Raises:
            InputError: a number is not finite, or out of its range.
            Exception: one of `_DAMAGED`.
        """
        ranges = self.trained_on
        pairs = [ranges.pumping, ranges.concentration, ranges.tracer]
        scaling = self.scaling
        named: dict[str, Any] = {
            'time_step': self.time_step,
            'trust': self.trust,
            'scaling': dataclasses.astuple(scaling),
            'trained_on': [*pairs, *ranges.rates, *ranges.tracer_rates],
            'largest_residual': ranges.largest_residual,
            **{name: tensor.numpy() for name, tensor in self.network.state_dict().items()},
        }
        for name, values in named.items():
            if not np.isfinite(np.asarray(values, dtype=float)).all():
                raise InputError(f'{name} of the model holds no finite number; train it again')
        if not 0.0 <= self.trust <= 1.0:
            raise InputError(f'trust {self.trust:g} is not from 0 to 1; train it again')
        if min(self.time_step, scaling.spread, scaling.rate, scaling.sigma) <= 0.0:
            raise InputError('time step and scaling must be positive; train it again')
        if not len(ranges.rates) == len(ranges.tracer_rates) == len(self.wells):
            raise InputError('trained_on does not have a range for every well; train it again')
        _ = self.summary  # reads the provenance, which may be damaged as well


def _unknown_rig(grid: Grid, wells: int) -> RigFields:
    """Return fields of the right shapes; those that the network keeps come with the weights."""
    flow = FlowShape(
        np.zeros((wells, grid.nz, grid.nx - 1)), np.zeros((wells, grid.nz - 1, grid.nx))
    )
    return RigFields(grid.shape, wells, flow, np.zeros(grid.shape), np.ones(grid.shape))
