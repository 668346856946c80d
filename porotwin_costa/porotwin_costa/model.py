"""A trained COSTA model: from a prediction to its corrective source term, with a safety gate."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import safetensors
import safetensors.torch
import torch
from numpy.typing import NDArray
from torch import nn

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import Rig
from porotwin_core.wells import WellRates
from porotwin_costa.dataset import TIME_STEP_TOLERANCE, rate_vector
from porotwin_costa.files import read_header, write_tensors
from porotwin_costa.flow_shape import FlowShape
from porotwin_costa.gate import Range, TrainingRange
from porotwin_costa.network import NetworkSettings, build_network
from porotwin_costa.physics_id import PhysicsId
from porotwin_costa.scaling import Scaling

FORMAT = 'porotwin-costa-model-1'

NO_MODEL = 'no model loaded'
APPLIED = 'applied'


@dataclass(frozen=True)
class Correction:
    """A corrective source term (nz, nx) [1/s] and what became of it.

    `status` is 'applied', 'no model loaded', or 'withheld: ' and the reason; `sigma` is zero unless
    applied.
    """

    sigma: FloatArray
    status: str

    @property
    def applied(self) -> bool:
        """Whether sigma comes from the network."""
        return self.status == APPLIED


@dataclass(frozen=True)
class CorrectiveModel:
    """sigma^{n+1} = DDM(c~^{n+1}, rates) (paper, eq. sigmadef), for one rig, grid and time step.

    `trust` in 0..1 scales the network's answer; training sets it by least squares on the samples
    it kept aside, so that a network which learned nothing of use says nothing. `provenance` tells
    what made the model: fingerprint of the data, seed, versions, losses. `physics` is what it
    corrects: the errors of another scheme, or of another belief about the rig, are others.
    """

    grid: Grid
    wells: tuple[str, ...]
    time_step: float
    settings: NetworkSettings
    network: nn.Module
    scaling: Scaling
    trained_on: TrainingRange
    trust: float
    provenance: Mapping[str, Any]
    physics: PhysicsId = field(default_factory=PhysicsId)

    def assess(self, predicted: FloatArray, rates: WellRates) -> Correction:
        """Return sigma for the predicted concentration (nz, nx), or zero and why it is withheld.

        Raises:
            InputError: `predicted` is not on the model's grid or an unknown well pumps.
        """
        if predicted.shape != self.grid.shape:
            raise InputError(
                f'prediction of shape {predicted.shape}: COSTA was trained on {self.grid}, shape '
                f'{self.grid.shape}; resample it or train for this grid'
            )
        vector = rate_vector(rates, self.wells)
        objection = self._futility() or self.trained_on.objection(
            predicted, vector, self.wells, whole_field=self.settings.architecture == 'paper'
        )
        if not objection:
            sigma = self._evaluate(predicted, vector)
            objection = self.trained_on.objection_to(sigma)
        if objection:
            return Correction(np.zeros(self.grid.shape), f'withheld: {objection}')
        return Correction(sigma, APPLIED)

    @property
    def summary(self) -> str:
        """One line for a person: which network, what made it, how far it is trusted."""
        made = self.provenance
        return (
            f'{self.settings.architecture} network on {self.grid}, {made["samples"]} pairs, seed '
            f'{made["seed"]}, validation loss {made["validation_loss"]:.3f}, trust {self.trust:.2f}'
        )

    def _futility(self) -> str:
        """Return why the training was in vain, or an empty string."""
        return '' if self.trust > 0 else 'training found nothing that holds on unseen frames'

    def corrective_source(self, predicted: FloatArray, rates: WellRates) -> FloatArray:
        """Return sigma (nz, nx) [1/s]: `assess` without its status."""
        return self.assess(predicted, rates).sigma

    def _evaluate(self, predicted: FloatArray, rates: FloatArray) -> FloatArray:
        concentration = (predicted - self.scaling.offset) / self.scaling.spread
        with torch.inference_mode():
            output = self.network(
                torch.as_tensor(concentration, dtype=torch.float32)[None],
                torch.as_tensor(rates / self.scaling.rate, dtype=torch.float32).reshape(1, -1),
            )
        return output[0].numpy().astype(float) * (self.scaling.sigma * self.trust)

    def for_wells(self, wells: tuple[str, ...], grid: Grid) -> Self:
        """Return this model after checking that it fits a rig's wells and grid.

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
        """Return this model after checking that it corrects the physics of `rig` on `grid`.

        `preset` names the scheme; empty: not known, so not checked.

        Raises:
            InputError: it was trained for other wells, another grid, scheme or rig description.
        """
        self.for_wells(tuple(rig.wells), grid)
        if difference := self.physics.difference(PhysicsId.of(rig, preset)):
            raise InputError(
                f'model corrects {difference}; choose what it was trained for, or train again'
            )
        return self

    @property
    def doubt(self) -> str:
        """One line if the model does not say which physics it corrects, else an empty string."""
        if self.physics.known:
            return ''
        return 'model does not say which rig and preset it corrects: not checked; train it again'

    def save(self, path: Path) -> None:
        """Write weights and description to one .safetensors file, whole or not at all."""
        tensors: dict[str, NDArray] = {
            name: tensor.numpy() for name, tensor in self.network.state_dict().items()
        }
        write_tensors(Path(path), tensors, FORMAT, self.description())

    def description(self) -> dict[str, Any]:
        """Return everything but the weights, as JSON knows it."""
        return {
            'grid': dataclasses.asdict(self.grid),
            'wells': list(self.wells),
            'time_step': self.time_step,
            'network': dataclasses.asdict(self.settings),
            'scaling': dataclasses.asdict(self.scaling),
            'trained_on': dataclasses.asdict(self.trained_on),
            'trust': self.trust,
            'physics': dataclasses.asdict(self.physics),
            'provenance': dict(self.provenance),
        }

    @classmethod
    def load(cls, path: Path) -> Self:
        """Return the model saved at `path`.

        Raises:
            InputError: no such file, a pickle, another format, weights that do not fit; one line.
        """
        path = Path(path)
        header = read_header(path, FORMAT)
        try:
            grid = Grid(**header['grid'])
            wells = tuple(header['wells'])
            settings = NetworkSettings(**header['network'])
            unknown_flow = FlowShape(
                np.zeros((len(wells), grid.nz, grid.nx - 1)),
                np.zeros((len(wells), grid.nz - 1, grid.nx)),
            )
            network = build_network(grid.shape, len(wells), settings, unknown_flow)
            weights = safetensors.torch.load_file(path)
            if settings.architecture == 'local':
                # models of before depth was kept took it for even
                weights.setdefault('relative_depth', torch.ones(grid.shape))
            network.load_state_dict(weights)
            network.eval()
            return cls(
                grid=grid,
                wells=wells,
                time_step=float(header['time_step']),
                settings=settings,
                network=network,
                scaling=Scaling(**header['scaling']),
                trained_on=_trained_on(header['trained_on']),
                trust=float(header['trust']),
                provenance=header['provenance'],
                physics=PhysicsId(**header.get('physics', {})),
            )
        except (KeyError, TypeError, RuntimeError, safetensors.SafetensorError) as error:
            reason = ' '.join(str(error).split())[:200]
            raise InputError(f'{path}: damaged model ({reason}); train it again') from None


def _trained_on(ranges: Mapping[str, Any]) -> TrainingRange:
    """Return the ranges with the tuples that JSON turned into lists."""

    def pair(values: Sequence[float]) -> Range:
        return float(values[0]), float(values[1])

    return TrainingRange(
        rates=tuple(pair(values) for values in ranges['rates']),
        tracer_rates=tuple(pair(values) for values in ranges['tracer_rates']),
        pumping=pair(ranges['pumping']),
        concentration=pair(ranges['concentration']),
        tracer=pair(ranges['tracer']),
        largest_residual=float(ranges['largest_residual']),
    )


def correction(
    model: CorrectiveModel | None, predicted: FloatArray, rates: WellRates, time_step: float
) -> Correction:
    """Return the model's correction of a prediction `time_step` [s] ahead.

    Zero and 'no model loaded' as long as there is none, zero if it was trained for another step.
    """
    if model is None:
        return Correction(np.zeros(predicted.shape), NO_MODEL)
    if not math.isclose(time_step, model.time_step, rel_tol=TIME_STEP_TOLERANCE):
        reason = f'time step {time_step:g} s, trained for {model.time_step:g} s'
        return Correction(np.zeros(predicted.shape), f'withheld: {reason}')
    return model.assess(predicted, rates)
