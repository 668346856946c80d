"""The corrective source term sigma of COSTA: computed, and withheld where it cannot be trusted.

    sigma^{n+1} = DDM(c~^{n+1}, rates)          (paper, eq. sigmadef)
    L c^{n+1}   = f_c + sigma^{n+1}             (paper, eq. costa_residual)

With learnt physics (`LearntPhysics`), c+^{n+1} is the prediction of the model that has it:

    sigma^{n+1} = phi (c+^{n+1} - c~^{n+1}) / dt + DDM(c+^{n+1}, rates)

`corrective_source` does the first line. The second one is solved by the physics-based model; the
result is kept within 0..1 by `Correction.applied_to`. The network is in `networks/`, its weights
and files in `corrective_model`, the checks in `gate`. The library torch is loaded with the first
network only.
"""

from typing import TYPE_CHECKING

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.correction import Correction
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.model.learnt_solver import LearntSolver
from porotwin_core.rates.wells import WellRates
from porotwin_costa.data.frames import rate_vector, same_time_step

if TYPE_CHECKING:
    from porotwin_costa.correction.corrective_model import CorrectiveModel
    from porotwin_costa.networks import Window

NO_MODEL = 'no model loaded'
APPLIED = 'applied'
WITHHELD = 'withheld: '
PHYSICS_ONLY = 'applied: learnt physics, without the network: '
"""The status of a correction is one of these; the last two are followed by a reason."""

LEAST_TRACER = 1e-5
"""Concentration of a cell that counts as tracer [-]; the fluxes of less are below 0.1 % of full."""


class LearntStep:
    """The learnt physics of a model, run by a solver from the state before a step."""

    def __init__(self, learnt: LearntPhysics, solver: LearntSolver) -> None:
        """Prepare the model without and with `learnt`.

        Raises:
            InputError: the model cannot run with this physics.
        """
        self._plain, self._better = solver.model(LearntPhysics()), solver.model(learnt)

    def predict(self, previous: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return c+^{n+1} (nz, nx), `time_step` [s] after `previous` (nz, nx)."""
        return self._better.predict(previous, rates, time_step)

    def sigma(self, change: FloatArray, time_step: float) -> FloatArray:
        """Return the sigma [1/s] that adds `change` (nz, nx) [-] to a prediction."""
        return self._plain.source_of(change, time_step)


def corrective_source(
    model: 'CorrectiveModel | None',
    predicted: FloatArray,
    rates: WellRates,
    time_step: float,
    previous: FloatArray | None = None,
    *,
    physics: LearntStep | None = None,
) -> Correction:
    """Return sigma (nz, nx) [1/s] for a predicted concentration, or the reason why there is none.

    Args:
        model: a trained model, or None.
        predicted: the prediction c~^{n+1} (nz, nx) of the physics-based model.
        rates: the rates of the wells during the time step.
        time_step: length of the time step [s].
        previous: the state c^n (nz, nx) before the step; learnt physics needs it.
        physics: runs the learnt physics of `model`; needed if it has any.

    Raises:
        InputError: `predicted` is not on the model's grid, or an unknown well pumps.
    """
    if model is None:
        return Correction(None, NO_MODEL)
    if not same_time_step(time_step, model.time_step):
        return _withheld(f'time step {time_step:g} s, trained for {model.time_step:g} s')
    if predicted.shape != model.grid.shape:
        raise InputError(
            f'prediction of shape {predicted.shape}: COSTA was trained on {model.grid}, shape '
            f'{model.grid.shape}; resample it or train for this grid'
        )
    vector = rate_vector(rates, model.wells)
    if model.learnt is None:
        sigma, objection = _network_part(model, predicted, vector)
        return Correction(sigma, APPLIED) if sigma is not None else _withheld(objection)
    if previous is None or physics is None:
        return _withheld('learnt physics needs a solver and the state before the step')
    better = np.clip(physics.predict(previous, rates, time_step), 0.0, 1.0)
    by_physics = physics.sigma(better - predicted, time_step)
    sigma, objection = _network_part(model, better, vector)
    if sigma is None:
        return Correction(by_physics, f'{PHYSICS_ONLY}{objection}', model.learnt)
    return Correction(by_physics + sigma, APPLIED, model.learnt)


def _network_part(
    model: 'CorrectiveModel', predicted: FloatArray, rates: FloatArray
) -> tuple[FloatArray | None, str]:
    """Return the sigma [1/s] of the network, or None and why it is withheld."""
    if objection := _objection(model, predicted, rates):
        return None, objection
    sigma = _network_output(model, predicted, rates)
    objection = model.trained_on.objection_to(sigma)
    return (None, objection) if objection else (sigma, '')


def _withheld(reason: str) -> Correction:
    return Correction(None, f'{WITHHELD}{reason}')


def _objection(model: 'CorrectiveModel', predicted: FloatArray, rates: FloatArray) -> str:
    """Return why the network shall not be asked, or an empty string."""
    if model.trust <= 0:
        return 'training found nothing that holds on unseen frames'
    whole_field = model.architecture.reach is None
    return model.trained_on.objection(predicted, rates, model.wells, whole_field=whole_field)


def _network_output(
    model: 'CorrectiveModel', predicted: FloatArray, rates: FloatArray
) -> FloatArray:
    """Return trust times sigma [1/s] as the network computes it; `rates` has shape (wells, 2).

    A network with a reach is asked about the part of the grid with tracer alone: elsewhere it
    moves none.
    """
    import torch

    scaling, reach = model.scaling, model.architecture.reach
    sigma = np.zeros(predicted.shape)
    scaled = torch.as_tensor(scaling.concentration(predicted), dtype=torch.float32)[None]
    vector = torch.as_tensor(rates / scaling.rate, dtype=torch.float32).reshape(1, -1)
    with torch.inference_mode():
        if reach is None:
            sigma[:] = model.network(scaled, vector)[0].numpy()
        elif (window := _around_tracer(predicted, reach)) is not None:
            output = model.network.forward_windows(scaled, vector, [window])[0].numpy()
            z, x, nz, nx = window
            sigma[z : z + nz, x : x + nx] = output
    return sigma * (scaling.sigma * model.trust)


def _around_tracer(predicted: FloatArray, reach: int) -> 'Window | None':
    """Return the window of all cells with tracer and of what influences them; None without any."""
    from porotwin_costa.networks import Window

    cells = np.argwhere(predicted > LEAST_TRACER)
    if len(cells) == 0:
        return None
    margin = reach + 2  # one for the face between two cells, one for the limiter
    low = np.maximum(cells.min(axis=0) - margin, 0)
    high = np.minimum(cells.max(axis=0) + margin + 1, predicted.shape)
    return Window(int(low[0]), int(low[1]), *(int(size) for size in high - low))
