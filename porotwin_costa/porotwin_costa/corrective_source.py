"""The corrective source term sigma of COSTA: computed, and withheld where it cannot be trusted.

    sigma^{n+1} = DDM(c~^{n+1}, rates)          (paper, eq. sigmadef)
    L c^{n+1}   = f_c + sigma^{n+1}             (paper, eq. costa_residual)

`corrective_source` does the first line. The second one is solved by the physics-based model; the
result is kept within 0..1 by `Correction.applied_to`. The network is in `networks/`, its weights
and files in `corrective_model`, the checks in `gate`.
"""

import numpy as np
import torch

from porotwin_core.correction import Correction
from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.wells import WellRates
from porotwin_costa.corrective_model import CorrectiveModel
from porotwin_costa.frames import rate_vector, same_time_step

NO_MODEL = 'no model loaded'
APPLIED = 'applied'
WITHHELD = 'withheld: '
"""The status of a correction is one of these; the last one is followed by a reason."""


def corrective_source(
    model: CorrectiveModel | None, predicted: FloatArray, rates: WellRates, time_step: float
) -> Correction:
    """Return sigma (nz, nx) [1/s] for a predicted concentration, or the reason why there is none.

    Args:
        model: a trained model, or None.
        predicted: the prediction c~^{n+1} (nz, nx) of the physics-based model.
        rates: the rates of the wells during the time step.
        time_step: length of the time step [s].

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
    if objection := _objection(model, predicted, vector):
        return _withheld(objection)
    sigma = _network_output(model, predicted, vector)
    if objection := model.trained_on.objection_to(sigma):
        return _withheld(objection)
    return Correction(sigma, APPLIED)


def _withheld(reason: str) -> Correction:
    return Correction(None, f'{WITHHELD}{reason}')


def _objection(model: CorrectiveModel, predicted: FloatArray, rates: FloatArray) -> str:
    """Return why the network shall not be asked, or an empty string."""
    if model.trust <= 0:
        return 'training found nothing that holds on unseen frames'
    whole_field = model.architecture.reach is None
    return model.trained_on.objection(predicted, rates, model.wells, whole_field=whole_field)


def _network_output(model: CorrectiveModel, predicted: FloatArray, rates: FloatArray) -> FloatArray:
    """Return trust times sigma [1/s] as the network computes it; `rates` has shape (wells, 2)."""
    scaling = model.scaling
    with torch.inference_mode():
        output = model.network(
            torch.as_tensor(scaling.concentration(predicted), dtype=torch.float32)[None],
            torch.as_tensor(rates / scaling.rate, dtype=torch.float32).reshape(1, -1),
        )
    return np.asarray(output[0].numpy().astype(float) * (scaling.sigma * model.trust))
