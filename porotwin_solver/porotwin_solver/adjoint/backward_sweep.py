"""The backward sweep: the adjoint of a simulation, from its last map to its first step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_solver.adjoint.adjoint_state import AdjointState
from porotwin_solver.adjoint.forward_sweep import ForwardSweep
from porotwin_solver.adjoint.parameter_difference import ParameterDifference
from porotwin_solver.adjoint.step_adjoint import (
    StepAdjoint,
    coefficient_derivatives,
    flow_adjoint,
    step_adjoint,
)
from porotwin_solver.coefficients.physics import Physics, in_and_out
from porotwin_solver.model.engine import Engine, State
from porotwin_solver.model.model import Model


@dataclass(frozen=True)
class SweepDerivatives:
    """Derivatives of the cost: by rate and injected concentration of every well, by parameters.

    `rate` and `concentration` hold (intervals,) per well, `parameters` is (n,).
    """

    rate: dict[str, FloatArray]
    concentration: dict[str, FloatArray]
    parameters: FloatArray


def sweep_backward(
    model: Model,
    times: FloatArray,
    forward: ForwardSweep,
    varied: Sequence[ParameterDifference],
    *,
    by_concentration: bool = True,
) -> SweepDerivatives:
    """Return the derivatives of the cost of `forward` at `times` [s]; its kept states are consumed.

    Without `by_concentration`, those by concentrations are right for injected tracer alone.

    Raises:
        InputError: the iterative solver for large grids does not converge.
    """
    engine = model.engine
    count = len(forward.intervals)
    found = SweepDerivatives(
        {name: np.zeros(count) for name in engine.physics.wells},
        {name: np.zeros(count) for name in engine.physics.wells},
        np.zeros(len(varied)),
    )
    by_parameter = found.parameters
    everywhere = by_concentration or bool(varied)
    empty_cells = everywhere or any(adds_tracer(each.rates) for each in forward.intervals)
    bar = AdjointState.equilibrium(np.zeros(engine.grid.shape))
    for index in range(count - 1, -1, -1):
        interval = forward.intervals[index]
        rates = interval.rates
        if interval.observed:
            last = interval.states.pop()
            for observed in interval.observed:
                time, map_bar = float(times[observed]), forward.map_bars[observed]
                by_parameter += _map_adjoint(model, bar, last, time, map_bar, varied)
        _, length = engine.splitting(interval.end - interval.start, interval.longest_step)
        while interval.states:
            first = interval.states.pop()
            record = interval.records.pop()
            step = step_adjoint(
                engine,
                first,
                rates,
                length,
                bar,
                varied,
                record=record,
                empty_cells=empty_cells,
                by_rates=True,
            )
            by_parameter += step.by_parameter
            by_parameter += coefficient_derivatives(varied, rates, first, step)
            by_source = flow_adjoint(engine, first, rates, bar, step.derivatives)
            by_well = well_derivatives(engine, rates, step, by_source)
            for name in engine.physics.wells:
                found.rate[name][index] += by_well[0][name]
                found.concentration[name][index] += by_well[1][name]
    return found


def _map_adjoint(
    model: Model,
    bar: AdjointState,
    state: State,
    time: float,
    map_bar: FloatArray,
    varied: Sequence[ParameterDifference],
) -> FloatArray:
    """Add dJ/dstate through the map at `time` [s] to `bar`; return dJ/dparameter through it."""
    engine, operator, grid = model.engine, model.observation_operator, model.grid
    concentration = engine.mean_concentration(state)
    bar.add_by_mean(engine, operator.apply_adjoint(concentration, grid, time, map_bar))

    def weighted(varied_model: Model) -> float:
        mean = varied_model.engine.mean_concentration(state)
        shown = varied_model.observation_operator.apply(mean, grid, time)
        return float(np.vdot(map_bar, shown))

    return np.array([one.derivative(weighted) for one in varied])


def adds_tracer(rates: WellRates) -> bool:
    """Return whether a well at rest holds tracer: its derivative asks for tracer in empty cells."""
    return any(well.rate == 0.0 and well.concentration > 0.0 for well in rates.values())


def well_derivatives(
    engine: Engine,
    rates: WellRates,
    step: StepAdjoint,
    by_source: FloatArray | None,
) -> tuple[dict[str, float], dict[str, float]]:
    """Return dJ/drate and dJ/dconcentration of every well through one step under `rates`.

    A rate acts through its unit flow, through the sources of its cells and, by `by_source`, through
    the tracer-driven flow. For a well at rest it is the derivative for the start of an injection.
    """
    if not engine.physics.wells:
        return {}, {}
    at, units = engine.sources_and_sinks, engine.flux_per_rate(rates)
    flux_bar, sources_bar, _ = step.derivatives.advection
    by_unit = units.x.reshape(len(at.all), -1) @ flux_bar.x.ravel()
    by_unit += units.z.reshape(len(at.all), -1) @ flux_bar.z.ravel()
    found_rate, found_concentration = {}, {}
    for name, source_sink in engine.physics.wells.items():
        commanded = rates.get(name, WellRate())
        factor = engine.physics.rate_factors.get(name, 1.0)
        stock = engine.physics.stock_factors.get(name, 1.0)
        by_rate = float(by_unit[at.all.index(source_sink)])
        if by_source is not None and engine.coupling is not None:
            by_rate += engine.coupling.sources_and_sinks.disc_mean(source_sink, by_source)
        by_tracer = 0.0
        if commanded.rate >= 0:
            by_tracer = at.disc_mean(source_sink, sources_bar.tracer)
            by_inflow = at.disc_mean(source_sink, sources_bar.inflow)
            by_rate += by_inflow + stock * commanded.concentration * by_tracer
        else:
            by_rate -= at.disc_mean(source_sink, sources_bar.outflow)
        found_rate[name] = step.starting.get(name, by_rate)
        found_concentration[name] = stock * factor * max(commanded.rate, 0.0) * by_tracer
    return by_commands(engine.physics, rates, found_rate), found_concentration


def by_commands(
    physics: Physics, rates: WellRates, by_delivered: Mapping[str, float]
) -> dict[str, float]:
    """Return the derivatives with respect to commanded rates, from those for delivered rates.

    They differ by the rate factor f of a well. In a closed rig the sinks follow
    (`Physics.delivered`): with the derivatives g for delivered rates, the shares w of the sinks and
    the ratio k of injected and withdrawn water with factors,

        dJ/dr = f (g - sum of w g) for a source, k f (g - sum of w g) for a sink.

    This holds for changes of commands that keep them balanced.
    """
    factors = {name: physics.rate_factors.get(name, 1.0) for name in by_delivered}
    found = {name: factors[name] * value for name, value in by_delivered.items()}
    if not physics.rate_factors or not physics.contact.closed:
        return found
    with_factors = {name: well.rate * factors[name] for name, well in rates.items()}
    put_in, taken = in_and_out(with_factors.values())
    if taken == 0.0:
        return found
    sinks = {name: -rate for name, rate in with_factors.items() if rates[name].rate < 0.0}
    followed = sum(share / taken * by_delivered[name] for name, share in sinks.items())
    return {
        name: (put_in / taken if name in sinks else 1.0) * factors[name] * (value - followed)
        for name, value in by_delivered.items()
    }
