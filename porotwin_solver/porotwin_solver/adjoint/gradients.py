"""The gradient of a cost of a simulation by rates, injected concentrations and parameters."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.adjoint.adjoint_state import refuse_not_finite
from porotwin_solver.adjoint.backward_sweep import sweep_backward
from porotwin_solver.adjoint.forward_sweep import Cost, sweep_forward
from porotwin_solver.adjoint.parameter_difference import (
    ParameterDifference,
    ParameterName,
    refuse_unavailable,
)
from porotwin_solver.model.model import Model


@dataclass(frozen=True)
class Gradient:
    """The cost of a simulation and its derivatives.

    cost: the sum over all maps.
    intervals: start and end [s] of the intervals with constant rates.
    rate: per well (intervals,), derivative by its rate in each interval [1/(m^3/s)]. For a well at
        rest it is the derivative for the start of an injection.
    concentration: per well (intervals,), derivative by the concentration that it injects.
    parameters: (n,), derivative by each requested parameter, per unit of that parameter.
    """

    cost: float
    intervals: tuple[tuple[float, float], ...]
    rate: dict[str, FloatArray]
    concentration: dict[str, FloatArray]
    parameters: FloatArray


@one_blas_thread()
def gradient(
    rig: Rig,
    schedule: Schedule,
    times: Sequence[float] | FloatArray,
    cost: Cost,
    *,
    grid: Grid,
    preset: str = 'fast',
    effects: Iterable[EffectDescription] = (),
    parameters: Sequence[ParameterName] = (),
    start: float = 0.0,
    by_concentration: bool = True,
) -> Gradient:
    """Return the sum of `cost` over the maps at `times` [s] of `simulate`, and its gradient.

    `parameters` are (effect, parameter) names among the effects of the rig and the given `effects`.
    The other arguments are as in `simulate`. The run time is a few simulations for any number of
    rates; each parameter adds a fraction of one. It is shorter without `by_concentration`: the
    derivatives by injected concentrations are then right for wells that inject tracer alone.

    Raises:
        InputError: a parameter without a gradient (the offset of the clock; dispersivities that are
            equal; diffusion where there is none), an effect with an onset, water in a tube, a
            result that is not finite, or as `simulate`.
    """
    described = (*rig.effects, *effects)
    model = Model(rig.model_copy(update={'effects': ()}), grid, preset=preset, effects=described)
    refuse_unavailable(parameters, model)
    varied = [ParameterDifference(rig, grid, preset, described, name) for name in parameters]
    moments = np.asarray(times, dtype=float)
    forward = sweep_forward(model, schedule, moments, start, cost, varied=bool(varied))
    derivatives = sweep_backward(model, moments, forward, varied, by_concentration=by_concentration)
    by_well = (*derivatives.rate.values(), *derivatives.concentration.values())
    refuse_not_finite(forward.cost, *by_well, derivatives.parameters)
    return Gradient(
        forward.cost,
        tuple((interval.start, interval.end) for interval in forward.intervals),
        derivatives.rate,
        derivatives.concentration,
        derivatives.parameters,
    )
