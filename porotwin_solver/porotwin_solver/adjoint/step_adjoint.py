"""The adjoint of one splitting step of the engine."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_solver.adjoint.adjoint_state import AdjointState
from porotwin_solver.adjoint.diffusion_adjoint_kernels import (
    exchange_adjoint,
    exchange_along_lines_adjoint,
    weights_adjoint,
)
from porotwin_solver.adjoint.parameter_difference import ParameterDifference
from porotwin_solver.adjoint.step_recorder import is_symmetric
from porotwin_solver.adjoint.transport_adjoint_kernels import (
    AdvectionDerivatives,
    advection_adjoint,
)
from porotwin_solver.coefficients.compiled import NEGLIGIBLE
from porotwin_solver.coefficients.face_field import FaceField
from porotwin_solver.coefficients.water_contact import WaterContact
from porotwin_solver.model.engine import Engine, State, StepCoefficients, StepRecord
from porotwin_solver.model.model import Model
from porotwin_solver.transport.diffusion import (
    DispersionTensor,
    Exchanges,
    diffuse,
    dispersion_tensor,
    dispersion_tensor_adjoint,
)
from porotwin_solver.transport.sources_and_sinks import with_water, with_water_adjoint
from porotwin_solver.transport.transport import Sources

NEGLIGIBLE_DERIVATIVE = 1e-100
"""Derivatives by a concentration that are smaller count as zero. Far from the cost they would fall
below the smallest normal number, 2e-308, where the processor takes ten times as long."""


class StepDerivatives(NamedTuple):
    """Derivatives of the cost by the coefficients of one step, in the shapes of these.

    `mobile_water` (nz, nx) is the derivative by the volume of mobile water of each cell, `tensor`
    the one by the dispersion tensor.
    """

    advection: AdvectionDerivatives
    mobile_water: FloatArray
    tensor: DispersionTensor

    @classmethod
    def zeros(cls, grid: Grid) -> 'StepDerivatives':
        """Return derivatives that are zero."""

        def zero() -> FloatArray:
            return np.zeros(grid.shape)

        return cls(
            AdvectionDerivatives(FaceField.zeros(grid), Sources(zero(), zero(), zero()), zero()),
            zero(),
            DispersionTensor(zero(), zero(), zero()),
        )


class StepAdjoint(NamedTuple):
    """The coefficients of a step and the derivatives of the cost.

    `derivatives` are those by the coefficients; `by_parameter` (n,) are those by the parameters,
    as far as they act through reactions. `starting` holds those by the rate of each well that
    starts alone, where no water moves: upstream then depends on the well.
    """

    coefficients: StepCoefficients
    derivatives: StepDerivatives
    by_parameter: FloatArray
    starting: dict[str, float]


def step_adjoint(
    engine: Engine,
    first: State,
    rates: WellRates,
    length: float,
    bar: AdjointState,
    varied: Sequence[ParameterDifference] = (),
    *,
    coefficients: StepCoefficients | None = None,
    record: StepRecord | None = None,
    empty_cells: bool = True,
    by_rates: bool = False,
) -> StepAdjoint:
    """Apply the adjoint of the step of `length` [s] from `first`, and consume its `record`.

    The derivatives by the parameters `varied` are part of the result. `rates` are [m^3/s] by well.
    Turns `bar` in place from dJ/d(state after the step) into dJ/d(state before it), apart from the
    part through the tracer-driven flow (`flow_adjoint`). Without a `record` the step is run again,
    and without given `coefficients` those of the step are computed. Without `empty_cells`, `bar` is
    zero in cells without tracer. That is right if nothing adds tracer there. `by_rates` tells that
    `StepAdjoint.starting` is wanted: it takes a step for each well, where no water moves.

    Raises:
        InputError: as `Engine.coefficients`.
    """
    if record is not None:
        coefficients = record.coefficients
    elif coefficients is None:
        coefficients = engine.coefficients(first, rates, length)
    half = coefficients.exchanges.levels.duration
    with_tensor = bool(varied) or engine.physics.disperses
    if record is None:
        diffusion = not is_symmetric(engine, coefficients, varied=bool(varied))
        record = engine.recorded_step(first.copy(), coefficients, diffusion=diffusion)
    by_parameter = _reaction_derivatives(varied, bar, record.last, half)
    rests = by_rates and not (coefficients.flux.x.any() or coefficients.flux.z.any())
    starting = _starting(engine, first, rates, length, bar, coefficients) if rests else {}
    engine.react_adjoint(bar, half)
    derivatives = StepDerivatives.zeros(engine.grid)
    _transport_adjoint(
        engine,
        bar,
        coefficients,
        record,
        derivatives,
        engine.contact(rates),
        with_tensor=with_tensor,
        empty_cells=empty_cells,
    )
    by_parameter += _reaction_derivatives(varied, bar, first, half)
    engine.react_adjoint(bar, half)
    bar.mobile[np.abs(bar.mobile) < NEGLIGIBLE_DERIVATIVE] = 0.0
    return StepAdjoint(coefficients, derivatives, by_parameter, starting)


def _starting(
    engine: Engine,
    first: State,
    rates: WellRates,
    length: float,
    bar: State,
    at_rest: StepCoefficients,
) -> dict[str, float]:
    """Return the derivatives by delivered rates [m^3/s] of wells that start alone.

    They are one-sided differences. A closed rig has none, because no well can start alone there.
    """
    if engine.physics.contact.closed:
        return {}
    # the root of round-off suits a one-sided difference
    rate = math.sqrt(NEGLIGIBLE) * float(engine.storage.min()) / length
    rest, found = first.copy(), {}
    engine.step(rest, at_rest)
    for name in engine.physics.wells:
        concentration = rates.get(name, WellRate()).concentration
        moved, started = first.copy(), {**rates, name: WellRate(rate, concentration)}
        engine.step(moved, engine.coefficients(first, started, length))
        gain = np.vdot(bar.mobile, moved.mobile - rest.mobile)
        gain += np.vdot(bar.immobile, moved.immobile - rest.immobile)
        found[name] = float(gain) / (rate * (engine.physics.rate_factors.get(name, 1.0) or 1.0))
    return found


def _transport_adjoint(
    engine: Engine,
    bar: AdjointState,
    coefficients: StepCoefficients,
    record: StepRecord,
    derivatives: StepDerivatives,
    contact: WaterContact,
    *,
    with_tensor: bool,
    empty_cells: bool,
) -> None:
    """Apply the adjoint of `Engine.transport`; the last state of `record` becomes the first."""
    c = record.last.mobile
    flux, sources, levels, exchanges = coefficients
    weight_bar = np.zeros_like(exchanges.weight)

    def diffusion_adjoint(tape: FloatArray) -> None:
        cells = (c.ravel(), bar.mobile.ravel(), engine.storage.ravel())
        bars = (weight_bar, derivatives.advection.storage.ravel())
        if len(tape) == 0:
            share = bar.mobile / engine.storage
            diffuse(share, engine.storage, exchanges, negligible=0.0)
            np.multiply(share, engine.storage, out=bar.mobile)
            return
        if exchanges.lines is None:
            exchange_adjoint(*cells, exchanges, tape, *bars)
            return
        length = exchanges.levels.duration / exchanges.lines.steps
        exchange_along_lines_adjoint(*cells, exchanges.lines, length, tape, *bars)

    if not empty_cells and exchanges.to_neighbours:
        reached = _reached(c, record.advection.is_awake)
        levels = levels.of(reached)
        bar.mobile.ravel()[~reached] = 0.0
    diffusion_adjoint(record.second_diffusion)
    advection_adjoint(
        c,
        bar.mobile,
        flux,
        sources,
        engine.storage,
        levels,
        int(engine.scheme),
        record.advection,
        derivatives.advection,
        *bar.bounds,
    )
    diffusion_adjoint(record.first_diffusion)
    with_water_adjoint(contact, flux, derivatives.advection.sources, derivatives.advection.flux)
    if with_tensor:
        _add_tensor_derivatives(engine, flux, exchanges, weight_bar, derivatives)


def _reached(c: FloatArray, is_awake: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells (nz * nx,) that a step gives tracer, if neighbours exchange it.

    `c` (nz, nx) is the concentration after the advection, `is_awake` (nz * nx,) as in its tape.
    """
    sends = is_awake.reshape(c.shape) | (c >= NEGLIGIBLE)
    reached = sends.copy()
    reached[1:] |= sends[:-1]
    reached[:-1] |= sends[1:]
    reached[:, 1:] |= sends[:, :-1]
    reached[:, :-1] |= sends[:, 1:]
    return reached.ravel()


def _add_tensor_derivatives(
    engine: Engine,
    flux: FaceField,
    exchanges: Exchanges,
    weight_bar: FloatArray,
    derivatives: StepDerivatives,
) -> None:
    """Add dJ/dtensor and dJ/dwater from dJ/dweight, and dJ/dflux through the tensor."""
    grid, physics = engine.grid, engine.physics
    scales = (1.0 / grid.dx**2, 1.0 / (grid.dx * grid.dz), 1.0 / grid.dz**2)
    tensor = dispersion_tensor(physics, flux)
    scaled = DispersionTensor(*(part * scale for part, scale in zip(tensor, scales, strict=True)))
    scaled_bar = DispersionTensor(*(np.zeros(grid.shape) for _ in range(3)))
    weights_adjoint(
        scaled, physics.mobile_water, exchanges, weight_bar, scaled_bar, derivatives.mobile_water
    )
    for tensor_bar, part, scale in zip(derivatives.tensor, scaled_bar, scales, strict=True):
        np.add(tensor_bar, part * scale, out=tensor_bar)
    by_flux = dispersion_tensor_adjoint(physics, flux, derivatives.tensor)
    flux_bar = derivatives.advection.flux
    flux_bar.x[:] += by_flux.x
    flux_bar.z[:] += by_flux.z


def flow_adjoint(
    engine: Engine, first: State, rates: WellRates, bar: AdjointState, derivatives: StepDerivatives
) -> FloatArray | None:
    """Add to `bar` the derivative through the tracer-driven flow; return dJ/dsource of that flow.

    `bar` is dJ/d(state before the step), `first` that state. None where the tracer does not change
    the flow.
    """
    if engine.coupling is None:
        return None
    by_mobile, by_source = engine.coupled_flux_adjoint(
        rates, first.mobile, derivatives.advection.flux
    )
    bar.add_by_mobile(engine, by_mobile)
    return by_source


def coefficient_derivatives(
    varied: Sequence[ParameterDifference], rates: WellRates, first: State, step: StepAdjoint
) -> FloatArray:
    """Return dJ/dparameter (n,) through the coefficients of the step from `first`."""
    flux = step.coefficients.flux
    return np.array(
        [
            one.derivative(lambda m: _weighted(m, rates, first, flux, step.derivatives))
            for one in varied
        ]
    )


def _weighted(
    model: Model, rates: WellRates, first: State, flux: FaceField, derivatives: StepDerivatives
) -> float:
    """Return the scalar product of the coefficients of `model` and the derivatives by them.

    The tensor and the water of canals are taken at the given `flux`: dJ/dflux already contains
    their dependence on the flux.
    """
    engine, physics = model.engine, model.engine.physics
    own_flux = engine.coupled_flux(engine.water_flux(rates), rates, first.mobile)
    own = engine.sources_and_sinks.sources(rates)
    sources = with_water(physics, engine.contact(rates), flux, own)
    advection = derivatives.advection
    parts = [
        np.vdot(advection.flux.x, own_flux.x),
        np.vdot(advection.flux.z, own_flux.z),
        *(np.vdot(by, value) for by, value in zip(advection.sources, sources, strict=True)),
        np.vdot(advection.storage, engine.storage),
        np.vdot(derivatives.mobile_water, physics.mobile_water),
    ]
    tensor = dispersion_tensor(physics, flux)
    parts += [np.vdot(by, value) for by, value in zip(derivatives.tensor, tensor, strict=True)]
    return float(sum(parts))


def _reaction_derivatives(
    varied: Sequence[ParameterDifference], bar: State, state: State, duration: float
) -> FloatArray:
    """Return dJ/dparameter (n,) through the reaction of `state` over `duration` [s]."""

    def reacted(model: Model) -> float:
        after = state.copy()
        model.engine.react(after, duration)
        return float(np.vdot(bar.mobile, after.mobile) + np.vdot(bar.immobile, after.immobile))

    return np.array([one.derivative(reacted) if one.reacts else 0.0 for one in varied])
