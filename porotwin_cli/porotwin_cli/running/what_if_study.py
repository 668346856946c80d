"""The outlooks of the siblings from a moment of a recording on: a present and a proposed plan.

The siblings learn from all maps of the recording up to that moment, as they would have beside the
rig. Then both plans start from the same state.
"""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

from porotwin_cli.options.experiment_times import MOST_TIMES
from porotwin_cli.running.loop_run import PLAN_PRESET
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.text_with_unit import plain_number, told_rate_ml_h
from porotwin_core.basis.units import DAY_S, HOUR_S, MINUTE_S, from_ml_h
from porotwin_core.clock.stamps import SAME_MOMENT_S
from porotwin_core.clock.time_units import MINUTES, TimeUnit, time_unit
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.model.state_filter import StateFilter
from porotwin_core.rates.bottle import Bottle, bottle_at
from porotwin_core.rates.delivered_rates import PumpFactor, rate_deviations
from porotwin_core.rates.fixed_pauses import FixedPauses
from porotwin_core.rates.rate_history import RateHistory
from porotwin_core.rates.rate_periods import OPEN_HORIZON_S, KnownRates, RatePeriod
from porotwin_core.rates.wells import (
    RateStep,
    Schedule,
    ScheduleRow,
    WellRate,
    WellRates,
    planned_rates,
    without_water,
)
from porotwin_core.rig import Rig
from porotwin_core.rig.coarse_grid import COARSE_CELLS, coarse_grid
from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.estimation.rate_learning import RateLearner
from porotwin_hub.loop.cycle import Observation
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import no_correction
from porotwin_imaging.measures.plume_measures import plume_cells
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_siblings.outlook import TIMES, Outlook
from porotwin_siblings.photograph import Photograph
from porotwin_siblings.proposed_rates import (
    LONGEST_HORIZON_S,
    check_balance,
    check_proposal,
    concentration_note,
    proposed_plan,
)
from porotwin_siblings.siblings import Siblings
from porotwin_siblings.zone_measure import REACHED_SHARE, ZoneMeasure
from porotwin_solver.effects import rig_at, tracer_storage
from porotwin_solver.model.model import Model
from porotwin_solver.model.rates_into_sand import rates_of_pumps
from porotwin_solver.model.water_balance import WaterBalance, water_balance

METER_S = 30.0
"""Time between two measurements of a pump [s], as the pumps of a rig send them."""

NO_ZONE = (
    'rig.yaml names no zone that tracer must stay out of (control.zone): the picture compares the '
    'plumes'
)
"""Told in place of the tracer in the zone."""

REACHED = f"{100.0 * REACHED_SHARE:g} % of the zone's pore volume is tracer"
"""When the zone counts as reached."""

UNITS_S = {'s': 1.0, 'min': MINUTE_S, 'h': HOUR_S, 'd': DAY_S}
"""Units of a time that a user writes [s]."""


@dataclass(frozen=True)
class WhatIfStudy:
    """Two forecasts from one state.

    Attributes:
        rig: the rig.
        grid: grid of the siblings, and of the maps in their forecasts.
        map_grid: grid of the recorded maps, and of the state.
        start: time of the state [s].
        state: the state estimate (nz, nx) [-].
        pumped: the rates of the recording [m^3/s].
        present: the outlook under the plan of the recording.
        proposed: the outlook under the proposed plan.
        seen_times: times of later photographs [s]; they were not learnt from.
        seen_tracer: tracer in the zone on these photographs [m^3]; NaN without a zone.
        seen_deviation: standard deviation of `seen_tracer` [m^3]: the systematic part of the maps,
            if known, and the noise of clean sand, see `zone_noise`.
        deviations_known: whether the maps tell deviations.
        objections: limits that the proposal breaks, and from when on; one line each.
        note: on concentrations other than those of rig.yaml, in one line; '' without any.
        rate_factors: share that each pump delivers, by well, as a hub believes.
        seconds: wall-clock time of both forecasts [s].
    """

    rig: Rig
    grid: Grid
    map_grid: Grid
    start: float
    state: FloatArray
    pumped: Schedule
    present: Outlook
    proposed: Outlook
    seen_times: FloatArray
    seen_tracer: FloatArray
    seen_deviation: FloatArray
    deviations_known: bool
    objections: tuple[str, ...]
    note: str
    rate_factors: dict[str, PumpFactor]
    seconds: float

    @property
    def has_zone(self) -> bool:
        """Whether the objective has a zone where no tracer must be."""
        return bool(np.isfinite(self.seen_tracer).all())

    def balance(self, rates: WellRates) -> WaterBalance | None:
        """Return the water balance at `rates` [m^3/s] on the grid of the siblings, at the end."""
        rig = rig_at(self.rig, self.start + float(self.present.times[-1]))
        return water_balance(rig, self.grid, rates)

    def pumped_plan(self, outlook: Outlook) -> list[RateStep]:
        """Return the plan of `outlook` without steps at which only levels of water change."""
        steps: list[RateStep] = []
        for step in outlook.plan:
            pumped = without_water(step.rates, self.rig.wells)
            if not steps or steps[-1].rates != pumped:
                steps.append(RateStep(step.start, pumped))
        return steps

    def bottle(self, outlook: Outlook) -> Bottle | None:
        """Return the tracer stock in its bottle at the end of `outlook`."""
        rows = [row for row in self.pumped.rows if row.time < self.start]
        for step in self.pumped_plan(outlook):
            begin = self.start + step.start
            rows += [ScheduleRow(begin, well, rate) for well, rate in step.rates.items()]
        plan = rates_of_pumps(self.rig, Schedule(tuple(rows)))
        return bottle_at(self.rig, plan, self.start + float(outlook.times[-1]))

    @property
    def time_unit(self) -> TimeUnit:
        """The unit of all times, by the end of the forecasts."""
        return time_unit(self.start + float(self.present.times[-1]))


def seconds_of(text: str) -> float:
    """Return a time such as 35min, 0.5h or 2100 in seconds; a number alone is in seconds.

    Raises:
        InputError: the text is no time.
    """
    for unit in sorted(UNITS_S, key=len, reverse=True):
        if text.endswith(unit):
            number, factor = text.removesuffix(unit), UNITS_S[unit]
            break
    else:
        number, factor = text, 1.0
    seconds = plain_number(number) * factor
    if not 0.0 <= seconds < np.inf:
        fault = 'is negative; ' if seconds < 0.0 else ''
        raise InputError(f"time '{text}': {fault}write a number and s, min, h or d, like 35min")
    return seconds


def rate_step(text: str, rig: Rig, start: float) -> RateStep:
    """Return the change of rates that a user writes as `[TIME:]WELL=ML_H[@C],WELL=ML_H[@C]`.

    Without a time it happens at `start` [s]. C is the injected concentration, from 0 (water) to 1
    (tracer stock). Without it, control wells inject water and fixed wells their fluid.

    Raises:
        InputError: the text is no change, or a well is unknown.
    """
    moment, colon, pairs = text.rpartition(':')
    after = seconds_of(moment) - start if colon else 0.0
    if after < 0.0:
        raise InputError(f"rates '{text}': {moment} lies before --at; give a later time, or none")
    rates = {}
    for pair in pairs.split(','):
        well, equals, amount = (part.strip() for part in pair.partition('='))
        number, at, fluid = (part.strip() for part in amount.partition('@'))
        if well and well not in rig.wells:
            comma = '; write 3.5 instead of 3,5' if well.isdecimal() else ''
            wells = ', '.join(rig.wells)
            raise InputError(
                f"rates '{text}': well '{well}' is unknown; the rig has {wells}{comma}"
            )
        if well in rates:
            raise InputError(f"rates '{text}': names {well} twice; give it one rate")
        rate = from_ml_h(told_rate_ml_h(number))
        if not (well and equals and np.isfinite(rate)):
            raise InputError(f"rates '{text}': write WELL=ML_H, like {next(iter(rig.wells))}=300")
        rates[well] = WellRate(
            rate, _concentration(text, fluid) if at else _usual_concentration(rig, well)
        )
    return RateStep(after, rates)


def _concentration(text: str, fluid: str) -> float:
    """Return the concentration [-] in the text `fluid` of the rates `text`."""
    concentration = plain_number(fluid)
    if not 0.0 <= concentration <= 1.0:
        raise InputError(
            f"rates '{text}': concentration '{fluid}' must be from 0, which is water, to 1, which "
            'is tracer stock'
        )
    return concentration


def _usual_concentration(rig: Rig, well: str) -> float:
    """Return the concentration [-] that `well` injects by rig.yaml; water where it says nothing."""
    fixed = rig.control.fixed.get(well) if rig.control is not None else None
    return fixed.concentration if fixed is not None else 0.0


def rate_steps(texts: Sequence[str], rig: Rig, start: float) -> list[RateStep]:
    """Return the changes of rates that a user writes, in the order of their times; see `rate_step`.

    Raises:
        InputError: as there, or two of them give a well different rates at the same time.
    """
    steps: list[RateStep] = []
    for text in texts:
        step = rate_step(text, rig, start)
        same = {well for one in steps if one.start == step.start for well in one.rates}
        if twice := sorted(same.intersection(step.rates)):
            raise InputError(
                f"rates '{text}': {twice[0]} has a rate at that time already; give it one rate"
            )
        steps.append(step)
    return sorted(steps, key=lambda step: step.start)


def study_what_if(
    recording: Recording,
    start: float,
    steps: Sequence[RateStep],
    *,
    executor: Executor,
    cells: int = COARSE_CELLS,
    horizon: float | None = None,
    siblings: int = 32,
    learnt: Callable[[int, int], None] = lambda *_: None,
    objected: Callable[[str], None] = lambda _: None,
) -> WhatIfStudy:
    """Return both outlooks from the last photograph until `start` [s] on.

    Args:
        recording: with maps and rates.
        start: when the plans part [s].
        steps: the proposed changes; their times count from `start`. Wells without a change follow
            the plan of the recording, and the producer balances them.
        executor: runs the siblings.
        cells: of the grid of the siblings, which is never finer than that of the maps.
        horizon: how far to look ahead of `start` [s]; None: to the end of the recording, but at
            least `OPEN_HORIZON_S` and at most `LONGEST_HORIZON_S`, or to the end of the experiment.
        siblings: number of siblings.
        learnt: called with the number of maps that were learnt from, and of all.
        objected: called with every limit that the proposal breaks, before the work begins.

    Raises:
        InputError: the recording holds no maps or rates before `start`, or the proposal has
            implausible rates, a change beyond the horizon, a horizon that is too long or passes the
            end of the experiment, or rates that do not balance in a closed rig.
    """
    times = recording.times
    unit = time_unit(times[-1])
    if start < times[0] - recording_step(times):
        raise InputError(
            f'{recording.source}: its first map is from {unit.precise(times[0])}; give a later --at'
        )
    if len(times) < 2:
        raise InputError(
            f'{recording.source}: has one map, from {unit.precise(times[0])}; a forecast needs '
            'more, from which the siblings learn'
        )
    if start > times[-1] + recording_step(times):
        last = unit.precise(times[-1])
        raise InputError(
            f'{recording.source}: its last map is from {last}; give --at {last.replace(" ", "")} '
            'or earlier'
        )
    newest = max(int(np.searchsorted(times, start + SAME_MOMENT_S, side='right')) - 1, 0)
    begin = float(times[newest])
    horizon = horizon_ahead(recording, start, horizon)
    check_proposal(steps, horizon, recording.rig, lambda after: unit.precise(start + after))
    ahead = start + horizon - begin
    if not ahead > 0.0:  # the state is of the first map, which may be later than `start`
        raise InputError(
            f'{recording.source}: its first map is from {unit.precise(begin)}, not before the end '
            'of the horizon; give a longer --horizon or a later --at'
        )
    present = _present_plan(recording, begin, ahead)
    producer = recording.rig.control.producer if recording.rig.control is not None else None
    proposed = proposed_plan(later_steps(steps, start - begin), present, producer)
    proposed = FixedPauses.of(recording.rig).rested_plan(proposed, begin, ahead)
    unit = time_unit(begin + ahead)
    check_balance(proposed, present, recording.rig, lambda after: unit.precise(begin + after))
    objections = objections_to(recording.rig, proposed, present, begin, unit)
    for line in objections:
        objected(line)
    maps = recording.grid
    grid = coarse_grid(recording.rig, maps, cells)
    family = Siblings(recording.rig, grid, map_grid=maps, executor=executor, count=siblings)
    pumps = _learn(family, recording, newest, learnt)
    after = np.linspace(0.0, ahead, TIMES + 1)[1:]
    maps_after = np.array([ahead / 2.0, ahead])
    clock = time.perf_counter()
    outlooks = [family.outlook(plan, ahead, after, maps_after) for plan in (present, proposed)]
    seconds = time.perf_counter() - clock
    later = [n for n in range(newest, len(times)) if times[n] <= begin + ahead]
    zone = ZoneMeasure.of(recording.rig, maps)
    assert recording.maps is not None
    shown = [np.asarray(recording.maps[n]) for n in later]
    seen = [zone.tracer(np.nan_to_num(values)) for values in shown]
    noise = [zone_noise(values, zone, maps) for values in shown]
    # the systematic errors of neighbouring cells are alike: their sum over the zone counts in full
    common = recording.maps.systematic
    doubt = [zone.tracer(np.nan_to_num(common[n])) if common is not None else 0.0 for n in later]
    return WhatIfStudy(
        rig=recording.rig,
        grid=grid,
        map_grid=maps,
        start=begin,
        state=family.state,
        pumped=recording.delivered,
        present=outlooks[0],
        proposed=outlooks[1],
        seen_times=np.array([times[n] for n in later]),
        seen_tracer=np.array(seen),
        seen_deviation=np.hypot(doubt, noise),
        deviations_known=common is not None,
        objections=objections,
        note=concentration_note([present, proposed], recording.rig),
        rate_factors=pumps,
        seconds=seconds,
    )


def horizon_ahead(recording: Recording, start: float, asked: float | None) -> float:
    """Return how far to look ahead of `start` [s]: as `asked`, but never past the end.

    All pumps stop at `control.end_min`. Maps after it show that the experiment went on.

    Raises:
        InputError: the experiment ends before `start` or within the `asked` horizon.
    """
    last, control = float(recording.times[-1]), recording.rig.control
    end_min = None if control is None else control.end_min
    left = math.inf if end_min is None else max(MINUTE_S * end_min, last) - start
    if left <= 0.0 or (asked is not None and asked > left):
        remedy = 'give an earlier --at' if left <= 0.0 else f'give --horizon {left:.0f}s at most'
        raise InputError(
            f'{recording.source}: the forecast would pass the end of the experiment, '
            f'control.end_min {end_min:g}; {remedy}, or correct rig.yaml'
        )
    usual = min(max(OPEN_HORIZON_S, last - start), LONGEST_HORIZON_S)
    return min(usual, left) if asked is None else asked


def zone_noise(values: FloatArray, zone: ZoneMeasure, grid: Grid) -> float:
    """Return the tracer [m^3] that the noise of clean sand alone would show in the zone.

    A map is never below 0, so its noise adds up over the zone: the mean of the clean cells of the
    map, in all clean cells of the zone.

    Args:
        values: the map (nz, nx) [-], NaN where nothing is seen.
        zone: the zone.
        grid: the grid of the map.
    """
    clean = np.isfinite(values) & ~plume_cells(values, grid)
    level = float(np.abs(values[clean]).mean()) if clean.any() else 0.0
    return zone.tracer(np.where(clean, level, 0.0))


def later_steps(steps: Sequence[RateStep], delay: float) -> list[RateStep]:
    """Return `steps` as seen from a state that is `delay` [s] earlier than their moment zero.

    Steps at the same time become one, and so do those before the state.
    """
    rates: dict[float, dict[str, WellRate]] = {}
    for step in sorted(steps, key=lambda step: step.start):
        rates.setdefault(max(step.start + delay, 0.0), {}).update(step.rates)
    return [RateStep(start, held) for start, held in rates.items()]


def recording_step(times: FloatArray) -> float:
    """Return the usual time between two of `times` [s]; 0 for one."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def _present_plan(recording: Recording, begin: float, ahead: float) -> tuple[RateStep, ...]:
    """Return the commanded rates from `begin` [s] over `ahead` [s], with the announced pauses.

    Where nothing was commanded these are the rates that pumps measured.
    """
    commands = recording.announced
    schedule = commands if commands is not None and commands.rows else recording.delivered
    return tuple(
        RateStep(low - begin, rates) for low, _, rates in schedule.intervals(begin, begin + ahead)
    )


def _learn(
    family: Siblings, recording: Recording, newest: int, learnt: Callable[[int, int], None]
) -> dict[str, PumpFactor]:
    """Let the siblings learn from the maps up to number `newest`; return the rate factors.

    A hub beside them learns these. It predicts and does not control. Where an effect of rig.yaml
    begins, its next state follows from no earlier one.
    """
    stride = max(1, newest // MOST_TIMES)
    chosen = [*range(newest % stride, newest, stride), newest]
    maps, before = recording.maps, None
    assert maps is not None
    delivered = recording.delivered
    rig, grid = family.rig, family.grid
    learner = RateLearner(rate_deviations(rig), grid, closed=rig.closed)
    meters = _Meters.of(recording)
    model = Model(rig, grid, preset=PLAN_PRESET)
    physics = _ModelInForce(model)
    hub = Twin(
        physics,
        no_correction,
        photo_interval=recording_step(recording.times[chosen]) or recording_step(recording.times),
        rates=RateHistory.of(rig),
        state_filter=StateFilter(tracer_storage(rig, grid), (grid.dz, grid.dx)),
        learner=learner,
    )
    for count, number in enumerate(chosen, start=1):
        now = float(recording.times[number])
        periods: list[RatePeriod] = (
            []
            if before is None
            else [RatePeriod(*period) for period in delivered.intervals(before, now)]
        )
        if physics.model is not (acting := model.at(now)):
            hub.interrupt()
            physics.model = acting
        for period in periods:
            meters.compare(period, learner)
        parts = _map(maps, number)
        values, *deviations = parts
        coarse = [
            one if one is None else conservative_resample(one, grid.shape) for one in deviations
        ]
        hub.cycle(
            Observation(now, conservative_resample(values, grid.shape), *coarse),
            [KnownRates(begin, begin, learner.told(rates)) for begin, _, rates in periods],
        )
        family.observe(Photograph.of(now, *parts), periods, learner.factors)
        before = now
        learnt(count, len(chosen))
    return learner.factors


@dataclass
class _ModelInForce:
    """Predicts with the `model` that has the effects of the moment."""

    model: Model

    def predict(self, concentration: FloatArray, rates: WellRates, time_step: float) -> FloatArray:
        """Return the prediction (nz, nx) [-] after `time_step` [s]."""
        return self.model.predict(concentration, rates, time_step)

    def correct(
        self, previous: FloatArray, sigma: FloatArray, rates: WellRates, time_step: float
    ) -> FloatArray:
        """Return the corrected prediction (nz, nx) [-] with the source `sigma` [1/s]."""
        return self.model.correct(previous, sigma, rates, time_step)


@dataclass(frozen=True)
class _Meters:
    """The meters of a recording, beside the rates that were `commanded`.

    They tell the rate of each well from its time in `since` [s] on, and end with `end` [s].
    """

    commanded: Schedule
    since: dict[str, float]
    end: float

    @classmethod
    def of(cls, recording: Recording) -> '_Meters':
        """Return the meters of `recording`: none without commands, or with rates by hand."""
        measured, commanded = recording.measured, recording.announced
        if measured is None or not measured.rows or commanded is None or recording.by_hand:
            return cls(Schedule(()), {}, 0.0)
        since = {row.well: row.time for row in reversed(measured.rows)}
        return cls(commanded, since, measured.rows[-1].time)

    def compare(self, period: RatePeriod, learner: RateLearner) -> None:
        """Let `learner` compare the measured rates of a `period` with the commands."""
        for now in np.arange(period.start, min(period.end, self.end), METER_S):
            begun = (well for well, since in self.since.items() if since <= now)
            told = {well: period.rates[well] for well in begun}
            learner.meter(told, self.commanded.at(now))


def _map(maps: ConcentrationMaps, number: int) -> tuple[FloatArray, Any, Any]:
    """Return a map with its total and systematic deviation, as far as the recording has them."""
    parts = (maps.deviation, maps.systematic)
    told = [None if part is None else np.asarray(part[number], dtype=float) for part in parts]
    return np.asarray(maps[number], dtype=float), told[0], told[1]


def objections_to(
    rig: Rig,
    plan: Sequence[RateStep],
    present: Sequence[RateStep],
    begin: float,
    unit: TimeUnit = MINUTES,
) -> tuple[str, ...]:
    """Return the limits of `rig` that a plan breaks, and from when on, one line each.

    There are none without a control section. A line that the `present` plan breaks at the same time
    is left out: somebody may stop a fixed well by hand, which no setpoint may do.

    Args:
        rig: the rig.
        plan: the proposed plan.
        present: the plan of the recording.
        begin: when both plans begin, on the clock of the recording [s].
        unit: of the times in the lines.
    """
    if rig.control is None:
        return ()
    limits = Limits.of(rig)
    since: dict[str, float] = {}
    before = held_before = present[0].rates
    for start in sorted({step.start for step in (*plan, *present)}):
        rates, held = planned_rates(plan, start), planned_rates(present, start)
        broken = limits.violations(held, held_before)
        for line in limits.violations(rates, before):
            if line not in broken:
                since.setdefault(line, begin + start)
        before, held_before = rates, held
    return tuple(f'from {unit.precise(time)}: {line}' for line, time in since.items())
