"""Gradients of a cost of a simulation, by the discrete adjoint: exact for the scheme that runs.

Every step of transport, diffusion and reaction is read backwards, from what the cells held before
each of their own steps. The limiters have kinks; beside them the derivative is that of the branch
taken. One forward run keeps the state before every step; backwards each step is run once more.

With J the cost, u the coefficients of a step (fluxes, sources, storage, dispersion) and s any rate
or parameter, dJ/ds = sum over the steps of dJ/du du/ds. dJ/du comes from the adjoint. Rates enter
u by superposition; for parameters of effects du/ds is a central difference of the coefficients,
which costs no simulation and, the coefficients being smooth, about eight digits are right. At the
end of a parameter's range, such as a decay of 0, it is a one-sided one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import EffectDescription, Rig
from porotwin_core.wells import Schedule, WellRate, WellRates
from porotwin_solver.adjoint_kernels import advection_adjoint, exchange_adjoint, weights_adjoint
from porotwin_solver.compiled import tape_length
from porotwin_solver.diffusion import Exchanges, diffuse, tensor, tensor_adjoint
from porotwin_solver.effects import effect as effect_named
from porotwin_solver.engine import Engine, State
from porotwin_solver.flow import FaceField
from porotwin_solver.model import Model
from porotwin_solver.physics import Physics
from porotwin_solver.refinement import refine
from porotwin_solver.transport import Pace, Sources, advect, pace

Cost = Callable[[int, FloatArray], tuple[float, FloatArray]]
"""From the index of a time and the map there (nz, nx) to its part of J and dJ/dmap (nz, nx)."""

STEP = 1e-5
"""Relative step of the differences of coefficients by parameters."""

DIFFERENCES: tuple[Mapping[float, float], ...] = (
    {1.0: 0.5, -1.0: -0.5},
    {0.0: -1.5, 1.0: 2.0, 2.0: -0.5},
    {0.0: 1.5, -1.0: -2.0, -2.0: 0.5},
)
"""Weights by steps: central, and for a parameter at its least or largest value one-sided; all of
second order."""


@dataclass(frozen=True)
class Gradient:
    """The cost of a simulation and its derivatives.

    `intervals`: the times [s] between which all rates are constant; `rate[well][k]` is the
    derivative by the rate [m^3/s] of `well` in interval k, `concentration[well][k]` that by the
    concentration it injects; for a well at rest, that of beginning to inject. `parameters[k]` is
    the derivative by the k-th parameter that was asked for, in its own unit.
    """

    cost: float
    intervals: tuple[tuple[float, float], ...]
    rate: dict[str, FloatArray]
    concentration: dict[str, FloatArray]
    parameters: FloatArray


@dataclass
class _Bars:
    """Derivatives of the cost by the coefficients of one step, the tensor's at `at_flux`."""

    flux: FaceField
    sources: Sources
    storage: FloatArray
    water: FloatArray
    tensor: tuple[FloatArray, FloatArray, FloatArray]
    at_flux: FaceField

    @classmethod
    def zeros(cls, grid: Grid) -> '_Bars':
        def zero() -> FloatArray:
            return np.zeros(grid.shape)

        return cls(
            FaceField.zeros(grid),
            Sources(zero(), zero(), zero()),
            zero(),
            zero(),
            (zero(), zero(), zero()),
            FaceField.zeros(grid),
        )


@dataclass
class _Interval:
    """A piece of the run with constant rates, and the states before each of its steps."""

    start: float
    end: float
    rates: WellRates
    shown: list[int] = field(default_factory=list)
    states: list[State] = field(default_factory=list)


def gradient(
    rig: Rig,
    schedule: Schedule,
    times: Sequence[float] | FloatArray,
    cost: Cost,
    *,
    grid: Grid,
    preset: str = 'fast',
    effects: Iterable[EffectDescription] = (),
    parameters: Sequence[tuple[str, str]] = (),
    start: float = 0.0,
) -> Gradient:
    """Return the sum of `cost` over the maps at `times` [s] of `simulate`, and its gradient.

    `parameters` names (effect, parameter) pairs of the rig's and the given `effects`.

    Raises:
        InputError: a parameter whose gradient is not there (the offset of the clock; dispersivities
            that are equal; spreading without any diffusion), and all that `simulate` refuses.
    """
    described = (*rig.effects, *effects)
    model = Model(rig.model_copy(update={'effects': ()}), grid, preset=preset, effects=described)
    _refuse(parameters, model.engine.physics)
    varied = [
        _Varied(rig, grid, preset, described, effect, parameter) for effect, parameter in parameters
    ]
    run = _Run(model, schedule, np.asarray(times, dtype=float), start)
    total, bars = run.forward(cost)
    return run.backward(total, bars, varied)


def _refuse(parameters: Sequence[tuple[str, str]], physics: Physics) -> None:
    for name, parameter in parameters:
        obstacle = effect_named(name).gradient_obstacle(physics, parameter)
        if obstacle:
            raise InputError(f'gradient by {name} {parameter}: {obstacle}')


class _Varied:
    """The model with one parameter changed a little, and the weights of a difference by it."""

    def __init__(
        self,
        rig: Rig,
        grid: Grid,
        preset: str,
        described: tuple[EffectDescription, ...],
        effect: str,
        parameter: str,
    ) -> None:
        values = [d.parameters.get(parameter) for d in described if d.name == effect]
        if not values or not isinstance(values[0], (int, float)):
            raise InputError(
                f"gradient by {effect} '{parameter}': not a number among the effects; "
                'give the effect with all its parameters'
            )
        self.step = STEP * (abs(values[0]) or 1.0)
        nominal = rig.model_copy(update={'effects': ()})

        def model(steps: float) -> Model:
            shifted = _shifted(described, effect, parameter, steps * self.step)
            return Model(nominal, grid, preset=preset, effects=shifted)

        for weights in DIFFERENCES:
            # what cannot be on one side of the value may be on the other
            with suppress(InputError):
                self.models = {model(steps): weight for steps, weight in weights.items()}
                return
        raise InputError(
            f'gradient by {effect} {parameter} = {values[0]:g}: no room to vary it on either side'
        )

    @property
    def reacts(self) -> bool:
        """Whether the parameter acts on decay or on the exchange with immobile water."""
        one, other, *_ = (model.engine.physics for model in self.models)
        return any(
            getattr(one, name) != getattr(other, name)
            for name in ('decay_rate', 'immobile_fraction', 'exchange_rate')
        )

    def difference(self, value: Callable[[Model], float]) -> float:
        """Return the difference of `value` by the parameter."""
        return sum(weight * value(model) for model, weight in self.models.items()) / self.step


def _shifted(
    described: Iterable[EffectDescription], effect: str, parameter: str, by: float
) -> list[EffectDescription]:
    shifted = []
    for description in described:
        if description.name == effect:
            values = dict(description.parameters)
            values[parameter] = float(values[parameter]) + by
            shifted.append(EffectDescription(name=effect, parameters=values))
            effect = ''
        else:
            shifted.append(description)
    return shifted


class _Run:
    """A simulation forth and back."""

    def __init__(self, model: Model, schedule: Schedule, times: FloatArray, start: float) -> None:
        self.model, self.engine = model, model.engine
        self.times = times
        self.intervals: list[_Interval] = []
        self.before_start: list[int] = []
        now = start
        for index, time in enumerate(times):
            target = time + model.operator.clock_offset
            for low, high, rates in schedule.intervals(now, target):
                self.intervals.append(_Interval(low, high, rates))
            now = max(now, target)
            shown = self.intervals[-1].shown if self.intervals else self.before_start
            shown.append(index)

    def forward(self, cost: Cost) -> tuple[float, dict[int, FloatArray]]:
        """Return the cost and its derivative by every map; keep the states before the steps."""
        engine = self.engine
        state = State.at_rest(refine(self.model.initial_condition(), engine.grid.shape))
        total, bars = 0.0, {}

        def look(indices: Iterable[int]) -> None:
            nonlocal total
            seen = engine.seen(state)
            for index in indices:
                shown = self.model.operator.shown(seen, self.model.grid, float(self.times[index]))
                part, bars[index] = cost(index, shown)
                total += part

        look(self.before_start)
        for interval in self.intervals:
            sources = engine.sources_and_sinks.sources(interval.rates)
            water = engine.flux(interval.rates)
            count, step = engine.steps(interval.end - interval.start)
            for place in range(count):
                if place == 0 or engine.coupling is not None:
                    flux = engine.moving(water, interval.rates, state.mobile)
                    steps = pace(flux, sources, engine.storage, step)
                    pairs = engine.exchanges(flux, 0.5 * step)
                interval.states.append(state.copy())
                engine.step(state, flux, sources, steps=steps, pairs=pairs)
            if interval.shown:
                interval.states.append(state.copy())
                look(interval.shown)
        return total, bars

    def backward(
        self, total: float, map_bars: dict[int, FloatArray], varied: Sequence[_Varied]
    ) -> Gradient:
        """Return the gradient from the derivatives by every map."""
        wells = self.engine.physics.wells
        by_rate: dict[str, FloatArray] = {}
        by_concentration: dict[str, FloatArray] = {}
        for name in wells:
            by_rate[name] = np.zeros(len(self.intervals))
            by_concentration[name] = np.zeros(len(self.intervals))
        by_parameter = np.zeros(len(varied))
        bar = State.at_rest(np.zeros(self.engine.grid.shape))
        for index in range(len(self.intervals) - 1, -1, -1):
            interval = self.intervals[index]
            if interval.shown:
                last = interval.states.pop()
                for shown in interval.shown:
                    by_parameter += self._read_map(bar, last, shown, map_bars[shown], varied)
            while interval.states:
                first = interval.states.pop()
                bars = _Bars.zeros(self.engine.grid)
                by_parameter += self._read_step(interval, first, bar, bars, varied)
                by_parameter += _coefficient_parameters(varied, interval, first, bars)
                by_source = self._through_tracer(interval, first, bar, bars)
                self._by_rates(interval, bars, by_source, index, by_rate, by_concentration)
        return Gradient(
            total,
            tuple((interval.start, interval.end) for interval in self.intervals),
            by_rate,
            by_concentration,
            by_parameter,
        )

    def _read_map(
        self, bar: State, state: State, index: int, map_bar: FloatArray, varied: Sequence[_Varied]
    ) -> FloatArray:
        """Add the derivative by the map at `index` to `bar`; return that by the parameters."""
        engine, operator, grid = self.engine, self.model.operator, self.model.grid
        time = float(self.times[index])
        seen_bar = operator.shown_adjoint(engine.seen(state), grid, time, map_bar)
        share = engine.physics.immobile_fraction
        bar.mobile += (1.0 - share) * seen_bar
        bar.immobile += share * seen_bar
        return np.array(
            [
                one.difference(
                    lambda m: float(
                        np.vdot(map_bar, m.operator.shown(m.engine.seen(state), grid, time))
                    )
                )
                for one in varied
            ]
        )

    def _read_step(
        self, interval: _Interval, first: State, bar: State, bars: _Bars, varied: Sequence[_Varied]
    ) -> FloatArray:
        """Read the step from `first` backwards; return the derivatives by reaction parameters."""
        engine = self.engine
        sources = engine.sources_and_sinks.sources(interval.rates)
        flux = engine.moving(engine.flux(interval.rates), interval.rates, first.mobile)
        _, step = engine.steps(interval.end - interval.start)
        steps = pace(flux, sources, engine.storage, step)
        pairs = engine.exchanges(flux, 0.5 * step)
        state, tapes = first.copy(), _Tapes(steps, pairs)
        engine.react(state, 0.5 * step)
        diffuse(state.mobile, engine.storage, pairs, tape=tapes.before)
        advect(
            state.mobile,
            flux,
            sources=sources,
            pore_volume=engine.storage,
            steps=steps,
            scheme=engine.scheme,
            tape=tapes.advection,
        )
        diffuse(state.mobile, engine.storage, pairs, tape=tapes.after)
        by_parameter = _reaction_parameters(varied, bar, state, 0.5 * step)
        engine.react_adjoint(bar, 0.5 * step)
        c, pair_bar = state.mobile, np.zeros_like(pairs.weight)
        _diffusion_back(c, bar.mobile, engine, pairs, tapes.after, pair_bar, bars)
        _advection_back(c, bar.mobile, engine, flux, sources, steps, tapes.advection, bars)
        _diffusion_back(c, bar.mobile, engine, pairs, tapes.before, pair_bar, bars)
        by_parameter += _reaction_parameters(varied, bar, first, 0.5 * step)
        engine.react_adjoint(bar, 0.5 * step)
        if varied or engine.physics.disperses:
            _weights_back(engine, flux, pairs, pair_bar, bars)
        return by_parameter

    def _through_tracer(
        self, interval: _Interval, first: State, bar: State, bars: _Bars
    ) -> FloatArray | None:
        """Add to `bar` what acts through the tracer-driven flow; return the part by sources."""
        if self.engine.coupling is None:
            return None
        by_mobile, by_source = self.engine.moving_adjoint(interval.rates, first.mobile, bars.flux)
        bar.mobile += by_mobile
        return by_source

    def _by_rates(
        self,
        interval: _Interval,
        bars: _Bars,
        by_source: FloatArray | None,
        index: int,
        by_rate: dict[str, FloatArray],
        by_concentration: dict[str, FloatArray],
    ) -> None:
        engine = self.engine
        for name, source_sink in engine.physics.wells.items():
            told = interval.rates.get(name, WellRate())
            factor = engine.physics.rate_factors.get(name, 1.0)
            at, units = engine.sources_and_sinks, engine.unit_fluxes
            unit = at.all.index(source_sink)
            through = float(np.vdot(bars.flux.x, units.x[unit]))
            through += float(np.vdot(bars.flux.z, units.z[unit]))
            if by_source is not None and engine.coupling is not None:
                through += engine.coupling.sources_and_sinks.mean(source_sink, by_source)
            if told.rate >= 0:
                tracer = at.mean(source_sink, bars.sources.tracer)
                through += at.mean(source_sink, bars.sources.inflow) + told.concentration * tracer
                by_concentration[name][index] += factor * told.rate * tracer
            else:
                through -= at.mean(source_sink, bars.sources.outflow)
            by_rate[name][index] += factor * through


class _Tapes:
    """What the cells hold before each of their steps in one step of the engine."""

    def __init__(self, steps: Pace, pairs: Exchanges) -> None:
        self.before = np.empty(tape_length(pairs.reach))
        self.advection = np.empty(tape_length(steps.reach))
        self.after = np.empty(tape_length(pairs.reach))


def _advection_back(
    c: FloatArray,
    bar: FloatArray,
    engine: Engine,
    flux: FaceField,
    sources: Sources,
    steps: Pace,
    tape: FloatArray,
    bars: _Bars,
) -> None:
    advection_adjoint(
        c,
        bar,
        flux.x,
        flux.z,
        *sources,
        engine.storage,
        *steps,
        engine.scheme,
        tape,
        bars.flux.x,
        bars.flux.z,
        *bars.sources,
        bars.storage,
    )


def _diffusion_back(
    c: FloatArray,
    bar: FloatArray,
    engine: Engine,
    pairs: Exchanges,
    tape: FloatArray,
    pair_bar: FloatArray,
    bars: _Bars,
) -> None:
    exchange_adjoint(
        c.ravel(),
        bar.ravel(),
        engine.storage.ravel(),
        pairs.time_step,
        pairs.start,
        pairs.other,
        pairs.weight,
        pairs.level.ravel(),
        pairs.order,
        pairs.reach,
        tape,
        pair_bar,
        bars.storage.ravel(),
    )


def _weights_back(
    engine: Engine, flux: FaceField, pairs: Exchanges, pair_bar: FloatArray, bars: _Bars
) -> None:
    """From the pairs of cells to the dispersion tensor, and on to the flux it depends on."""
    grid, physics = engine.grid, engine.physics
    xx, xz, zz = tensor(physics, flux)
    scales = (1.0 / grid.dx**2, 1.0 / (grid.dx * grid.dz), 1.0 / grid.dz**2)
    scaled = [np.zeros(grid.shape) for _ in range(3)]
    weights_adjoint(
        xx * scales[0],
        xz * scales[1],
        zz * scales[2],
        physics.mobile_water,
        pairs.level,
        pairs.start,
        pairs.other,
        pair_bar,
        scaled[0],
        scaled[1],
        scaled[2],
        bars.water,
    )
    for by_tensor, part, scale in zip(bars.tensor, scaled, scales, strict=True):
        np.add(by_tensor, part * scale, out=by_tensor)
    by_flux = tensor_adjoint(physics, flux, bars.tensor)
    bars.flux.x[:] += by_flux.x
    bars.flux.z[:] += by_flux.z
    # the tensor's own dependence on the flux is now in that by the flux
    bars.at_flux = flux


def _weighted(model: Model, interval: _Interval, first: State, bars: _Bars) -> float:
    """Return the coefficients of `model` in `interval`, weighted by the derivatives by them."""
    engine, physics = model.engine, model.engine.physics
    flux = engine.moving(engine.flux(interval.rates), interval.rates, first.mobile)
    sources = engine.sources_and_sinks.sources(interval.rates)
    parts = [
        np.vdot(bars.flux.x, flux.x),
        np.vdot(bars.flux.z, flux.z),
        *(np.vdot(by, value) for by, value in zip(bars.sources, sources, strict=True)),
        np.vdot(bars.storage, engine.storage),
        np.vdot(bars.water, physics.mobile_water),
    ]
    tensors = tensor(physics, bars.at_flux)
    parts += [np.vdot(by, value) for by, value in zip(bars.tensor, tensors, strict=True)]
    return float(sum(parts))


def _coefficient_parameters(
    varied: Sequence[_Varied], interval: _Interval, first: State, bars: _Bars
) -> FloatArray:
    """Return the derivatives by parameters that act on the coefficients of `interval`."""
    return np.array(
        [one.difference(lambda model: _weighted(model, interval, first, bars)) for one in varied]
    )


def _reaction_parameters(
    varied: Sequence[_Varied], bar: State, state: State, duration: float
) -> FloatArray:
    """Return the derivatives by parameters that act on the reaction of `state`."""

    def reacted(model: Model) -> float:
        after = state.copy()
        model.engine.react(after, duration)
        return float(np.vdot(bar.mobile, after.mobile) + np.vdot(bar.immobile, after.immobile))

    return np.array([one.difference(reacted) if one.reacts else 0.0 for one in varied])
