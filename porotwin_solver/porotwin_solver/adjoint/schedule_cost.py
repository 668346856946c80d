"""The cost of a schedule from any state, and its derivatives by the rates of all its steps.

The cost is a sum of terms of the true concentration (`CostTerm`). A running term is integrated by
the trapezoidal rule over the splitting steps. The gradient is the discrete adjoint of exactly this.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.wells import RateStep, check_plan, plan_intervals
from porotwin_solver.adjoint.adjoint_state import AdjointState, refuse_not_finite
from porotwin_solver.adjoint.backward_sweep import adds_tracer, well_derivatives
from porotwin_solver.adjoint.step_adjoint import flow_adjoint, step_adjoint
from porotwin_solver.adjoint.step_recorder import MOST_KEPT_BYTES, StepRecorder
from porotwin_solver.coefficients.refinement import coarsen, coarsen_adjoint, refine
from porotwin_solver.model.engine import State, StepCoefficients, StepRecord
from porotwin_solver.model.model import Model, validated_duration

ADJOINT_RUNS = 5
"""Cost of a gradient in simulations, at most: the run, its repetition, and the adjoint."""


@dataclass(frozen=True)
class ScheduleCost:
    """The cost of a schedule, in the unit of its terms (times s, where they are integrated).

    `gradient` (steps, wells) is the derivative by the rate of every well [cost s/m^3], in the order
    of the rig's wells; None where it was not asked for. For a well at rest it is the derivative for
    the start of an injection. `gradient[0]` holds from the state to the second step.
    """

    cost: float
    gradient: FloatArray | None


class _KeptStep(NamedTuple):
    """A splitting step of `length` [s]: its first state, coefficients and step of the schedule."""

    first: State
    coefficients: StepCoefficients
    length: float
    number: int
    record: StepRecord | None


class _Weight(NamedTuple):
    """A term and its weight [s] at one state: of the trapezoidal rule, or 1 for a final term."""

    term: CostTerm
    weight: float


def schedule_cost(
    model: Model,
    initial: FloatArray,
    plan: Sequence[RateStep],
    *,
    horizon: float,
    terms: Sequence[CostTerm],
    with_gradient: bool = True,
) -> ScheduleCost:
    """Return the cost of a `plan` of rates from the state `initial` (nz, nx), and its gradient.

    Mobile and immobile water start from the same concentration. The effects of the model act.

    Args:
        model: the physics-based model; its supervision bounds the work.
        initial: concentration [-] on the model's grid.
        plan: the rates; its times [s] count from the initial state.
        horizon: length of the simulation [s].
        terms: of the cost, on the model's grid.
        with_gradient: False: the cost alone, at a fifth of the time.

    Raises:
        InputError: NaN or another shape, times outside the horizon, an unknown well, rates that do
            not balance in a closed rig, the supervision refuses the work, or the cost or its
            gradient is not finite.
    """
    start = model.validated_map(initial, 'initial')
    end = validated_duration(horizon, 'horizon')
    check_plan(plan)
    for term in terms:
        term.check(model.grid.shape, end)
    run = _Run(model, plan, terms, end)
    state = State.equilibrium(refine(start, model.engine.grid.shape))
    cost, kept = run.forward(state, keep=with_gradient)
    refuse_not_finite(cost)
    if not with_gradient:
        return ScheduleCost(cost, None)
    gradient = run.backward(state, kept)
    refuse_not_finite(cost, gradient)
    return ScheduleCost(cost, gradient)


class _Run:
    """One simulation: forward with the cost, backward with the gradient."""

    def __init__(
        self, model: Model, plan: Sequence[RateStep], terms: Sequence[CostTerm], horizon: float
    ) -> None:
        self.model, self.engine, self.plan = model, model.engine, plan
        self.terms, self.horizon = terms, horizon
        self.weights: list[list[_Weight]] = []
        """The weights of the terms at every state: before the first step, after each step."""

    def forward(self, state: State, *, keep: bool) -> tuple[float, list[_KeptStep]]:
        """Advance `state` to the horizon; return the cost, and the steps if they are to be kept.

        Raises:
            InputError: as `Engine.supervised_interval`.
        """
        engine = self.engine
        engine.supervision.refuse_too_long(self.horizon)
        self._refuse_too_costly(state, keep=keep)
        self.weights = list(self._weights())
        cost = self._cost(state, 0)
        kept: list[_KeptStep] = []
        recorder = StepRecorder(engine)
        count = 0
        for low, high, number in self._intervals():
            _, length = engine.splitting(high - low)
            rates = self.plan[number].rates
            for coefficients in engine.supervised_interval(state, rates, high - low):
                if keep:
                    first = state.copy()
                    record = recorder.step(state, coefficients)
                    kept.append(_KeptStep(first, coefficients, length, number, record))
                else:
                    engine.step(state, coefficients)
                count += 1
                cost += self._cost(state, count)
        return cost, kept

    def backward(self, last: State, kept: list[_KeptStep]) -> FloatArray:
        """Return the gradient (steps, wells); `last` is the last state, `kept` is consumed.

        Raises:
            InputError: the iterative solver for large grids does not converge.
        """
        engine = self.engine
        wells = list(engine.physics.wells)
        found = np.zeros((len(self.plan), len(wells)))
        bar = AdjointState.equilibrium(np.zeros(engine.grid.shape))
        self._add_cost_derivative(bar, last, len(kept))
        empty_cells = any(adds_tracer(step.rates) for step in self.plan)
        while kept:
            engine.supervision.check()
            first, coefficients, length, number, record = kept.pop()
            rates = self.plan[number].rates
            step = step_adjoint(
                engine,
                first,
                rates,
                length,
                bar,
                coefficients=coefficients,
                record=record,
                empty_cells=empty_cells,
                by_rates=True,
            )
            by_source = flow_adjoint(engine, first, rates, bar, step.derivatives)
            by_rate, _ = well_derivatives(engine, rates, step, by_source)
            found[number] += [by_rate[name] for name in wells]
            self._add_cost_derivative(bar, first, len(kept))
        return found

    def _intervals(self) -> Iterator[tuple[float, float, int]]:
        edges = [time for term in self.terms for time in (term.start, term.end)]
        return plan_intervals(self.plan, edges, self.horizon)

    def _weights(self) -> Iterator[list[_Weight]]:
        """Yield the weights of the terms at the state before the first step, and after each."""
        before = self._weights_at(0.0, 0.0)
        for low, high, _ in self._intervals():
            steps, length = self.engine.splitting(high - low)
            running = [t for t in self.terms if t.is_running and t.start <= low and high <= t.end]
            yield before + [_Weight(term, 0.5 * length) for term in running]
            for _ in range(steps - 1):
                yield [_Weight(term, length) for term in running]
            before = [_Weight(term, 0.5 * length) for term in running]
            before += self._weights_at(low, high)
        yield before

    def _weights_at(self, after: float, until: float) -> list[_Weight]:
        """Return the weights of the terms that are taken at the time `until` [s]."""
        return [
            _Weight(term, 1.0)
            for term in self.terms
            if not term.is_running and (term.end == until or after < term.end < until)
        ]

    def _cost(self, state: State, index: int) -> float:
        if not self.weights[index]:
            return 0.0
        shown = self._map_of(state)
        return sum(weight * term.value(shown) for term, weight in self.weights[index])

    def _map_of(self, state: State) -> FloatArray:
        return coarsen(self.engine.mean_concentration(state), self.model.grid.shape)

    def _add_cost_derivative(self, bar: AdjointState, state: State, index: int) -> None:
        """Add the derivative of the cost by the state `index` to `bar` in place."""
        if not self.weights[index]:
            return
        shown = self._map_of(state)
        by_map = np.zeros(shown.shape)
        for term, weight in self.weights[index]:
            by_map += weight * term.derivative(shown)
        bar.add_by_mean(self.engine, coarsen_adjoint(by_map, bar.mobile.shape))

    def _refuse_too_costly(self, state: State, *, keep: bool) -> None:
        """Refuse a simulation from `state` that takes too long or too much memory as a whole.

        Raises:
            InputError: with the estimate.
        """
        engine = self.engine
        steps = sum(engine.splitting(high - low)[0] for low, high, _ in self._intervals())
        kept = steps * 2 * engine.grid.nx * engine.grid.nz * np.dtype(float).itemsize
        if keep and kept > MOST_KEPT_BYTES:
            raise InputError(
                f'gradient over {self.horizon:g} s on {engine.grid}: it keeps {kept / 1e9:.1f} GB; '
                'ask for a shorter horizon or a coarser grid'
            )
        runs = ADJOINT_RUNS if keep else 1
        engine.refuse_too_costly(state, self.plan, self._intervals(), runs=runs)
