"""What the page knows at one moment, and how each thing that arrives changes it.

A snapshot is never changed: every `with_...` returns the next one. A browser's picture is made
from one snapshot, so it never mixes two moments, and no reader waits for a writer.
"""

import statistics
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum

from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig import Rig
from porotwin_core.wells import WellRates

HISTORY_LENGTH = 2000
"""Cycles kept for the curves: more than 16 hours of a photograph every 30 s."""

SETPOINTS_KEPT = 20
MARKS_KEPT = 50
NODES_KEPT = 64
ARRIVALS_KEPT = 8
FORECASTS_KEPT = 3
REMARKS_KEPT = 6

TIME_TOLERANCE = 0.5
"""Times that differ by no more than this [s] are those of one photograph."""


@dataclass(frozen=True)
class Map:
    """Concentration (nz, nx) [-] over a rig at `time` [s]; NaN where nothing was seen.

    `number` tells one map from the next of its kind.
    """

    time: float
    concentration: FloatArray
    grid: Grid
    number: int = 0


@dataclass(frozen=True)
class Observation:
    """A state of the asset as it was seen; `arrival` is on this machine's steady clock [s]."""

    sequence: int
    map: Map
    arrival: float
    time_step: float = 0.0
    noise: float = float('nan')
    calibrated: bool = True
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Setpoint:
    """What the wells are asked to pump [m^3/s], from a photograph at `time` until `valid_until`.

    `arrival` is on the graph's clock [s], which need not agree with the camera's, whose the other
    two are; None: the graph had no time yet.
    """

    sequence: int
    time: float
    valid_until: float
    rates: WellRates
    reason: str
    arrival: float | None = None


@dataclass(frozen=True)
class CyclePoint:
    """One cycle on the curves; errors relative [-], tracer in m^3, duration in s, rates in m^3/s.

    NaN: there was no such number.
    """

    time: float
    prediction_error: float
    corrected_error: float
    disallowed_tracer: float
    cycle_duration: float
    corrected: bool = False
    correction_status: str = ''
    remarks: tuple[str, ...] = ()
    rates: WellRates = field(default_factory=dict)


@dataclass(frozen=True)
class Mark:
    """The sequence of time was broken at `time` [s], and why."""

    time: float
    reason: str


class Level(Enum):
    """What a node says of itself, from best to worst."""

    OK = 'ok'
    QUIET = 'quiet'
    """It runs and said nothing yet."""
    WARN = 'warn'
    ERROR = 'error'


@dataclass(frozen=True)
class Health:
    """What a node last said of itself.

    `present`: whether the graph shows it; None when the graph never did.
    """

    level: Level
    message: str
    arrival: float
    present: bool | None = None


@dataclass(frozen=True)
class Snapshot:
    """All that the page shows; None or empty where nothing arrived yet."""

    rig: Rig | None = None
    observation: Observation | None = None
    difference: FloatArray | None = None
    """The newest observation minus the forecast made for it, on the observation's grid."""
    predicted: tuple[Map, ...] = ()
    corrected: tuple[Map, ...] = ()
    setpoints: tuple[Setpoint, ...] = ()
    set_rates: WellRates | None = None
    """What a person said is set at the pumps; None: nobody did."""
    measured: WellRates | None = None
    pumps_report: bool = False
    """The pumps report what they delivered: no person has to."""
    confirmed: int | None = None
    """Sequence of the newest setpoint confirmed through this page."""
    history: tuple[CyclePoint, ...] = ()
    history_end: int = 0
    """Number of points ever added; the last of `history` has number `history_end` - 1."""
    history_start: int = 0
    """Number of the first point of this experiment; earlier ones were dropped."""
    marks: tuple[Mark, ...] = ()
    finished: str | None = None
    health: dict[str, Health] = field(default_factory=dict)
    arrivals: tuple[float, ...] = ()
    start: float | None = None
    """Time of the experiment's first photograph [s]."""
    maps_made: int = 0


def matching(maps: Iterable[Map], time: float) -> Map | None:
    """Return the newest of `maps` that is valid at `time` [s]."""
    found = None
    for candidate in maps:
        if abs(candidate.time - time) <= TIME_TOLERANCE:
            found = candidate
    return found


def photo_interval(snapshot: Snapshot) -> float | None:
    """Return how long one waits for a photograph [s]; None when only one came so far.

    The longer of what the photographs' times say and how they really come: a run can be faster or
    slower than its clock, and neither is a reason to call it stale.
    """
    gaps = [b - a for a, b in zip(snapshot.arrivals, snapshot.arrivals[1:], strict=False)]
    told = snapshot.observation.time_step if snapshot.observation else 0.0
    if not gaps and not told > 0:
        return None
    return max(told, statistics.median(gaps) if gaps else 0.0)


def with_rig(now: Snapshot, rig: Rig) -> Snapshot:
    """Return the snapshot with the description of the rig."""
    return replace(now, rig=rig)


def _numbered(now: Snapshot, map_: Map) -> tuple[Snapshot, Map]:
    number = now.maps_made + 1
    return replace(now, maps_made=number), replace(map_, number=number)


def _minus_forecast(observed: Map, now: Snapshot) -> FloatArray | None:
    forecast = matching(now.corrected, observed.time) or matching(now.predicted, observed.time)
    if forecast is None:
        return None
    values = observed.concentration
    return values - conservative_resample(forecast.concentration, values.shape)


def with_observation(now: Snapshot, observation: Observation) -> Snapshot:
    """Return the snapshot with a new state, set against the forecast that was made for it.

    A photograph from before the last one begins a new experiment: a bag was started again, or a
    clock was set back.
    """
    time = observation.map.time
    if now.observation is not None and time < now.observation.map.time:
        now = with_new_experiment(now, time)
    now, map_ = _numbered(now, observation.map)
    return replace(
        now,
        observation=replace(observation, map=map_),
        difference=_minus_forecast(map_, now),
        arrivals=(*now.arrivals, observation.arrival)[-ARRIVALS_KEPT:],
        start=time if now.start is None else now.start,
        finished=None,
    )


def with_predicted(now: Snapshot, map_: Map) -> Snapshot:
    """Return the snapshot with the physics-based forecast."""
    now, map_ = _numbered(now, map_)
    return replace(now, predicted=(*now.predicted, map_)[-FORECASTS_KEPT:])


def with_corrected(now: Snapshot, map_: Map) -> Snapshot:
    """Return the snapshot with the corrected forecast."""
    now, map_ = _numbered(now, map_)
    return replace(now, corrected=(*now.corrected, map_)[-FORECASTS_KEPT:])


def with_setpoint(now: Snapshot, setpoint: Setpoint) -> Snapshot:
    """Return the snapshot with a new setpoint.

    A hub that was started again counts from one: what was confirmed of the old count is forgotten.
    The report of its cycle may have come before it, as they travel on topics of their own.
    """
    restarted = now.setpoints and setpoint.sequence <= now.setpoints[-1].sequence
    kept = () if restarted else now.setpoints
    history = now.history
    if history and history[-1].time == setpoint.time and not history[-1].rates:
        history = (*history[:-1], replace(history[-1], rates=setpoint.rates))
    return replace(
        now,
        history=history,
        setpoints=(*kept, setpoint)[-SETPOINTS_KEPT:],
        confirmed=None if restarted else now.confirmed,
    )


def with_measured(now: Snapshot, rates: WellRates, *, by_person: bool) -> Snapshot:
    """Return the snapshot with rates that were set by a person, or measured by the pumps."""
    if by_person:
        return replace(now, set_rates=rates, measured=rates)
    return replace(now, measured=rates, pumps_report=True)


def with_confirmation(now: Snapshot, sequence: int) -> Snapshot:
    """Return the snapshot in which a setpoint was confirmed."""
    return replace(now, confirmed=sequence)


def with_cycle(now: Snapshot, point: CyclePoint) -> Snapshot:
    """Return the snapshot with one more point on the curves, the oldest dropped when full."""
    if now.history and point.time < now.history[-1].time:
        now = replace(now, history=(), history_start=now.history_end, marks=())
    told = next((s.rates for s in reversed(now.setpoints) if s.time == point.time), {})
    history = (*now.history, replace(point, rates=told, remarks=point.remarks[:REMARKS_KEPT]))
    return replace(now, history=history[-HISTORY_LENGTH:], history_end=now.history_end + 1)


def with_new_experiment(now: Snapshot, time: float) -> Snapshot:
    """Return the snapshot without what was before the experiment that starts at `time` [s].

    The rig, pumps and nodes stay. So does its first photograph, which may come before the word
    that it starts, as they travel on topics of their own.
    """
    alone = now.observation is not None and now.observation.map.time == now.start
    if alone and now.start is not None and abs(now.start - time) <= TIME_TOLERANCE:
        return now
    return replace(
        now,
        observation=None,
        difference=None,
        predicted=(),
        corrected=(),
        history=(),
        history_start=now.history_end,
        marks=(),
        finished=None,
        arrivals=(),
        start=None,
    )


def with_interruption(now: Snapshot, mark: Mark) -> Snapshot:
    """Return the snapshot in which the next state does not follow from the last."""
    return replace(now, marks=(*now.marks, mark)[-MARKS_KEPT:], predicted=(), corrected=())


def with_end(now: Snapshot, reason: str) -> Snapshot:
    """Return the snapshot of a finished experiment."""
    return replace(now, finished=reason or 'the experiment is over')


def _bounded(health: dict[str, Health]) -> dict[str, Health]:
    newest = sorted(health, key=lambda name: health[name].arrival)[-NODES_KEPT:]
    return {name: health[name] for name in sorted(newest)}


def with_health(now: Snapshot, name: str, said: Health) -> Snapshot:
    """Return the snapshot with what a node said of itself."""
    before = now.health.get(name)
    said = replace(said, present=before.present if before else None)
    return replace(now, health=_bounded({**now.health, name: said}))


def with_nodes(now: Snapshot, names: Iterable[str], arrival: float) -> Snapshot:
    """Return the snapshot with the names of the nodes that the graph shows now."""
    shown = set(names)
    health = {name: Health(Level.QUIET, 'running', arrival) for name in shown} | now.health
    for name, said in health.items():
        if name in shown or said.present:
            health[name] = replace(said, present=name in shown)
    return replace(now, health=_bounded(health))
