"""The newest data of the graph at one moment, and its change with every message.

A snapshot is immutable: every `with_...` function returns a new one. A browser's view is made from
one snapshot, so it never mixes two moments.
"""

import math
import statistics
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum

from porotwin_core.clock.freshness import STALE_AFTER_S
from porotwin_core.clock.stamps import SAME_PHOTOGRAPH_S
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rates.announced_rates import safe_rates_at
from porotwin_core.rates.fixed_pauses import NO_PAUSES, FixedPauses
from porotwin_core.rates.safe_rates import safe_rates
from porotwin_core.rates.wells import WellRates
from porotwin_core.rig import Rig
from porotwin_core.rig.control_zones import ZoneKind, control_zones
from porotwin_page.expectation import Expectation
from porotwin_page.packed_rates import PackedRates

HISTORY_LENGTH = 1440
"""Cycles in the curves: 12 hours of a photograph every 30 s, below 1 MB."""

TRACER_PLACES: dict[ZoneKind, str] = {
    'keep out': 'in the disallowed zone',
    'keep in': 'outside the allowed zone',
    'target': 'missing in the target, or too much',
}
"""Where the counted tracer is, by kind of zone; the first kind that a rig has counts."""

# Bounds of everything else, so that memory does not grow with the length of a run.
MOST_KEPT = 64
"""Setpoints, their events, marks, and nodes."""

ARRIVALS_KEPT = 8
FORECASTS_KEPT = 3
REMARKS_KEPT = 6


@dataclass(frozen=True)
class Map:
    """A concentration map.

    Attributes:
        time: when it is valid [s].
        concentration: values (nz, nx) [-], row 0 at the bottom; NaN where nothing was seen.
        grid: its grid.
        number: increases with every map of a snapshot.
    """

    time: float
    concentration: FloatArray
    grid: Grid
    number: int = 0


@dataclass(frozen=True)
class ObservedState:
    """A state of the asset, from one photograph.

    Attributes:
        sequence: its number.
        map: the concentration map.
        arrival: when it arrived, on this machine's steady clock [s].
        time_step: time since the state before [s]; 0 for the first one.
        noise: standard deviation of the map's noise [-]; NaN if unknown.
        calibrated: False if the scale of the concentration is a default.
        remarks: lines about the map for people.
    """

    sequence: int
    map: Map
    arrival: float
    time_step: float = 0.0
    noise: float = math.nan
    calibrated: bool = True
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Setpoint:
    """Commanded rates of the wells.

    Attributes:
        sequence: its number.
        time: time of its photograph, on the camera's clock [s].
        valid_until: end of its validity, on the camera's clock [s].
        rates: commanded rates [m^3/s].
        reason: one line for people.
        arrival: when it arrived, on the graph's clock [s], less the age of its photograph where the
            camera has that clock; None if that clock had not started.
        clock: when it arrived, on this machine's clock [s since 1970].
        doubt: reason not to pump its rates, in one line; empty without doubt.
    """

    sequence: int
    time: float
    valid_until: float
    rates: WellRates
    reason: str
    arrival: float | None = None
    clock: float = math.nan
    doubt: str = ''

    def remaining(self, now: float | None) -> float | None:
        """Return the remaining validity [s], counted from the photograph; negative after its end.

        Args:
            now: present time on the graph's clock [s]; None if it has not started.

        Returns:
            None without a clock.
        """
        if now is None or self.arrival is None:
            return None
        return self.arrival + (self.valid_until - self.time) - now


class Event(StrEnum):
    """An event of the log; the values are names on the page."""

    SETPOINT = 'setpoint'
    EXPIRED = 'expired'
    REPORTED = 'reported'
    """A person reported the rates at the pumps, on this page or elsewhere."""


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the log of setpoints.

    Attributes:
        clock: when it happened, on this machine's clock [s since 1970].
        event: its kind.
        sequence: number of the setpoint; None for a report that names none.
        rates: the rates that were commanded or reported [m^3/s]; the safe rates after an expiry.
    """

    clock: float
    event: Event
    sequence: int | None
    rates: WellRates


@dataclass(frozen=True, slots=True)
class CyclePoint:
    """The report of one cycle, a point of the curves; NaN where there is no number.

    Attributes:
        time: time of its photograph [s].
        prediction_error: relative L2 error of the physics-based prediction [-].
        corrected_error: relative L2 error of the corrected prediction [-].
        disallowed_tracer: observed tracer in the disallowed zone [m^3]; without such a zone, tracer
            that a target lacks or has too much.
        tracer_place: where that tracer is, in words; '' without an objective.
        cycle_duration: from the state to the setpoint [s].
        corrected: whether the prediction was corrected.
        correction_status: why it was not.
        remarks: lines for people.
        rates: commanded rates [m^3/s].
        objective: cost f with the new setpoint [m^3].
        objective_unchanged: cost f with unchanged rates [m^3].
        expected_error: relative L2 error that follows from the deviations of map and forecast [-].
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
    objective: float = math.nan
    objective_unchanged: float = math.nan
    expected_error: float = math.nan
    tracer_place: str = ''


@dataclass(frozen=True)
class Mark:
    """An interruption of the sequence of photographs, at `time` [s]."""

    time: float
    reason: str


@dataclass(frozen=True)
class MendOffer:
    """An offer of a diagnosis to mend the model.

    Attributes:
        sequence: its number.
        state: its state in words.
        is_open: whether it waits for an answer.
        time: of the last photograph that the diagnosis has seen [s].
        confidence: of the verdict [-].
        sentence: text for the operator.
        report: path of the report on the diagnosis; empty if there is none.
    """

    sequence: int
    state: str
    is_open: bool
    time: float
    confidence: float
    sentence: str
    report: str = ''


class Level(Enum):
    """Health of a node, from best to worst; the values are names of colours on the page."""

    OK = 'ok'
    QUIET = 'quiet'
    """The node runs but has not reported yet."""
    WARN = 'warn'
    ERROR = 'error'
    SILENT = 'silent'
    """Another node says that this one no longer reports."""


@dataclass(frozen=True)
class Health:
    """The last report of a node.

    Attributes:
        level: its health.
        message: one line.
        arrival: time of the last report of the node itself, on this machine's steady clock [s].
        present: whether the node is in the graph; None if it never was.
        ended: whether it said that it leaves, because its work is over.
        stale_after_s: of the supervisor: how long a healthy node is silent at most [s].
    """

    level: Level
    message: str
    arrival: float
    present: bool | None = None
    ended: bool = False
    stale_after_s: float = STALE_AFTER_S


@dataclass(frozen=True)
class GraphSnapshot:
    """Everything that the page shows; None or empty until it arrives.

    Attributes:
        rig: description of the rig.
        preparation: text on the work before the graph runs; may be empty.
        observed: the newest state.
        difference: newest observed map minus its forecast (nz, nx) [-].
        predicted: newest physics-based forecasts.
        corrected: newest corrected forecasts.
        setpoints: newest setpoints.
        set_rates: rates [m^3/s] that a person has reported; None without a report.
        measured: newest rates at the pumps [m^3/s].
        pumps_report: whether the pumps measure, so that no person has to report.
        confirmed: number of the setpoint that was confirmed last on this page, and whether the
            safe rates were confirmed, because it had expired.
        expired: number of the setpoint whose expiry is in the log; None if it is not over.
        log: newest setpoints, expiries and reports of rates.
        expected: newest forecast of the siblings with the present rates; None before it.
        offer: newest offer to mend the model; None before the first one.
        alarm: one line on wrong publishers of setpoints; empty if all is well.
        history: points of the curves.
        history_end: number of points ever added; `history` ends with number `history_end` - 1.
        history_start: number of the first point of this experiment.
        marks: interruptions.
        finished: why the experiment is over; None while it runs.
        health: last report of every node by name.
        arrivals: when the newest states arrived, on this machine's steady clock [s].
        states: number of states of the experiment so far.
        start: time of the first photograph of the experiment [s].
        began: start of the experiment that imaging has told [s]; None: it has told none.
        maps_made: number of maps ever added.
    """

    rig: Rig | None = None
    preparation: str = ''
    observed: ObservedState | None = None
    difference: FloatArray | None = None
    predicted: tuple[Map, ...] = ()
    corrected: tuple[Map, ...] = ()
    setpoints: tuple[Setpoint, ...] = ()
    set_rates: WellRates | None = None
    measured: WellRates | None = None
    pumps_report: bool = False
    confirmed: tuple[int, bool] | None = None
    expired: int | None = None
    log: tuple[LogLine, ...] = ()
    expected: Expectation | None = None
    offer: MendOffer | None = None
    alarm: str = ''
    history: tuple[CyclePoint, ...] = ()
    history_end: int = 0
    history_start: int = 0
    marks: tuple[Mark, ...] = ()
    finished: str | None = None
    health: dict[str, Health] = field(default_factory=dict)
    arrivals: tuple[float, ...] = ()
    states: int = 0
    start: float | None = None
    began: float | None = None
    maps_made: int = 0

    @property
    def safe_rates(self) -> WellRates:
        """The rates [m^3/s] to set after the end of a setpoint; empty if they are not known."""
        if self.rig is None or self.rig.control is None:
            return {}
        return safe_rates(self.rig)

    @property
    def pauses(self) -> FixedPauses:
        """The announced pauses; none before the start of the experiment is known."""
        if self.rig is None or self.began is None:
            return NO_PAUSES
        return FixedPauses.of(self.rig).since(self.began)

    def orders(self, graph: float | None) -> WellRates:
        """Return the rates to set [m^3/s]: the setpoint's, or the safe ones after its end.

        Args:
            graph: present time on the graph's clock [s]; None if it has not started.

        Returns:
            Nothing before the first setpoint; the expired rates if the safe ones are not known.
        """
        setpoint = self.setpoint
        if setpoint is None:
            return {}
        remaining = setpoint.remaining(graph)
        expired = remaining is not None and remaining <= 0
        return (expired and self.safe_at(graph)) or setpoint.rates

    def safe_at(self, graph: float | None) -> WellRates:
        """Return the safe rates [m^3/s] with the pauses announced for `graph` time [s].

        They are empty if they are not known.
        """
        if self.rig is None or self.rig.control is None:
            return {}
        elapsed = None if graph is None or self.began is None else graph - self.began
        return safe_rates_at(self.rig, elapsed)

    @property
    def setpoint(self) -> Setpoint | None:
        """The newest setpoint."""
        return self.setpoints[-1] if self.setpoints else None

    @property
    def forecast(self) -> Map | None:
        """The newest forecast; the corrected one if there are two of the same time."""
        predicted = self.predicted[-1] if self.predicted else None
        corrected = self.corrected[-1] if self.corrected else None
        if predicted is None or corrected is None:
            return predicted or corrected
        return corrected if corrected.time >= predicted.time else predicted

    @property
    def photo_interval(self) -> float | None:
        """Expected time between photographs [s]; None before the second one.

        This is the longer of the recorded interval and the interval between arrivals, because a
        replay may run faster or slower than its clock.
        """
        gaps = [b - a for a, b in zip(self.arrivals, self.arrivals[1:], strict=False)]
        recorded = self.observed.time_step if self.observed else 0.0
        if not gaps and not recorded > 0:
            return None
        return max(recorded, statistics.median(gaps) if gaps else 0.0)


def matching(maps: Iterable[Map], time: float) -> Map | None:
    """Return the last of `maps` that is valid at `time` [s]; None if there is none."""
    found = None
    for candidate in maps:
        if abs(candidate.time - time) <= SAME_PHOTOGRAPH_S:
            found = candidate
    return found


def _numbered(now: GraphSnapshot, map_: Map) -> tuple[GraphSnapshot, Map]:
    number = now.maps_made + 1
    return replace(now, maps_made=number), replace(map_, number=number)


def _minus_forecast(observed: Map, now: GraphSnapshot) -> FloatArray | None:
    forecast = matching(now.corrected, observed.time) or matching(now.predicted, observed.time)
    if forecast is None:
        return None
    values = observed.concentration
    return values - conservative_resample(forecast.concentration, values.shape)


def with_observed_state(now: GraphSnapshot, state: ObservedState) -> GraphSnapshot:
    """Return the snapshot with a new state and its difference from the forecast.

    A state older than the last one changes nothing else, so one wrong time stamp does not drop the
    curves.
    """
    time = state.map.time
    now, map_ = _numbered(now, state.map)
    return replace(
        now,
        observed=replace(state, map=map_),
        difference=_minus_forecast(map_, now),
        arrivals=(*now.arrivals, state.arrival)[-ARRIVALS_KEPT:],
        states=now.states + 1,
        start=time if now.start is None else now.start,
        finished=None,
    )


def with_predicted(now: GraphSnapshot, map_: Map) -> GraphSnapshot:
    """Return the snapshot with a physics-based forecast."""
    now, map_ = _numbered(now, map_)
    return replace(now, predicted=(*now.predicted, map_)[-FORECASTS_KEPT:])


def with_corrected(now: GraphSnapshot, map_: Map) -> GraphSnapshot:
    """Return the snapshot with a corrected forecast."""
    now, map_ = _numbered(now, map_)
    return replace(now, corrected=(*now.corrected, map_)[-FORECASTS_KEPT:])


def with_setpoint(now: GraphSnapshot, setpoint: Setpoint) -> GraphSnapshot:
    """Return the snapshot with a new setpoint.

    A restarted hub counts from one again; then the confirmation of an old setpoint is dropped. The
    report of a cycle may arrive before its setpoint, because topics keep no order between them.
    This function then adds the rates to the report.
    """
    restarted = now.setpoints and setpoint.sequence <= now.setpoints[-1].sequence
    kept = () if restarted else now.setpoints
    history = now.history
    if history and history[-1].time == setpoint.time and not history[-1].rates:
        history = (*history[:-1], replace(history[-1], rates=setpoint.rates))
    now = _with_line(now, setpoint.clock, Event.SETPOINT, setpoint.sequence, setpoint.rates)
    return replace(
        now,
        history=history,
        setpoints=(*kept, setpoint)[-MOST_KEPT:],
        confirmed=None if restarted else now.confirmed,
        expired=None,
    )


def _with_line(
    now: GraphSnapshot, clock: float, event: Event, sequence: int | None, rates: WellRates
) -> GraphSnapshot:
    line = LogLine(clock, event, sequence, rates)
    return replace(now, log=(*now.log, line)[-MOST_KEPT:])


def with_graph_time(now: GraphSnapshot, graph: float | None, clock: float) -> GraphSnapshot:
    """Return the snapshot at a later time; add a line to the log if the newest setpoint expired.

    Args:
        now: the snapshot before.
        graph: time on the graph's clock [s]; None if it has not started.
        clock: time on this machine's clock [s since 1970].
    """
    setpoint = now.setpoint
    if setpoint is None or now.expired == setpoint.sequence:
        return now
    remaining = setpoint.remaining(graph)
    if remaining is None or remaining > 0:
        return now
    now = _with_line(now, clock, Event.EXPIRED, setpoint.sequence, now.safe_at(graph))
    return replace(now, expired=setpoint.sequence)


def with_measured(
    now: GraphSnapshot, rates: WellRates, *, by_person: bool, clock: float = math.nan
) -> GraphSnapshot:
    """Return the snapshot with rates [m^3/s] that a person reported or the pumps measured.

    Args:
        now: the snapshot before.
        rates: the rates of all wells [m^3/s].
        by_person: whether a person reported them.
        clock: time on this machine's clock [s since 1970].
    """
    if by_person:
        now = _with_line(now, clock, Event.REPORTED, None, rates)
        return replace(now, set_rates=rates, measured=rates)
    return replace(now, measured=rates, pumps_report=True)


def with_confirmation(now: GraphSnapshot, sequence: int, *, safe: bool = False) -> GraphSnapshot:
    """Return the snapshot with the confirmation of setpoint `sequence`.

    `safe` is true if the setpoint had expired and the safe rates were confirmed.
    """
    return replace(now, confirmed=(sequence, safe))


def with_cycle(now: GraphSnapshot, point: CyclePoint) -> GraphSnapshot:
    """Return the snapshot with a new point of the curves; drop the oldest point if full."""
    rates = next((s.rates for s in reversed(now.setpoints) if s.time == point.time), {})
    newest = replace(
        point,
        rates=rates,
        tracer_place=_tracer_place(now.rig),
        remarks=point.remarks[:REMARKS_KEPT],
        correction_status=sys.intern(point.correction_status),
    )
    history = (*_packed(now.history), newest)
    return replace(now, history=history[-HISTORY_LENGTH:], history_end=now.history_end + 1)


def _tracer_place(rig: Rig | None) -> str:
    """Return where the tracer is that the hub counts, in words; see `Objective`."""
    kinds = {zone.kind for zone in control_zones(rig)} if rig is not None else set()
    return next((words for kind, words in TRACER_PLACES.items() if kind in kinds), '')


def _packed(history: tuple[CyclePoint, ...]) -> tuple[CyclePoint, ...]:
    """Return the points with the last one in little memory: only the newest remarks are shown."""
    if not history:
        return ()
    last = history[-1]
    before = history[-2].rates if len(history) > 1 else None
    return (*history[:-1], replace(last, rates=PackedRates(last.rates, before), remarks=()))


def with_new_experiment(now: GraphSnapshot, time: float) -> GraphSnapshot:
    """Return the snapshot without the data of experiments that began before `time` [s].

    Rig, pumps and nodes remain. The first photograph of the new experiment remains too, because it
    may arrive before this message.
    """
    shown = now.observed
    begun = shown is not None and abs(shown.map.time - time) <= SAME_PHOTOGRAPH_S
    if begun and now.states == 1:
        return now
    return replace(
        now,
        observed=shown if begun else None,
        difference=None,
        predicted=(),
        corrected=(),
        expected=None,
        history=(),
        history_start=now.history_end,
        marks=(),
        finished=None,
        arrivals=(),
        states=int(begun),
        start=time if begun else None,
    )


def with_interruption(now: GraphSnapshot, mark: Mark) -> GraphSnapshot:
    """Return the snapshot after an interruption, without forecasts."""
    return replace(now, marks=(*now.marks, mark)[-MOST_KEPT:], predicted=(), corrected=())


def with_end(now: GraphSnapshot, reason: str) -> GraphSnapshot:
    """Return the snapshot of a finished experiment."""
    return replace(now, finished=reason or 'the experiment is over')


def _newest_nodes(health: dict[str, Health]) -> dict[str, Health]:
    """Return the reports that are kept: of nodes seen in the graph before those of mere names."""

    def worth(name: str) -> tuple[bool, float]:
        return health[name].present is not None, health[name].arrival

    newest = sorted(health, key=worth)[-MOST_KEPT:]
    return {name: health[name] for name in sorted(newest)}


def with_health(now: GraphSnapshot, name: str, report: Health) -> GraphSnapshot:
    """Return the snapshot with the report of a node, or of the supervisor on its silence."""
    before = now.health.get(name)
    if before is not None:
        arrival = before.arrival if report.level is Level.SILENT else report.arrival
        report = replace(report, present=before.present, arrival=arrival)
    return replace(now, health=_newest_nodes({**now.health, name: report}))


def with_nodes(now: GraphSnapshot, names: Iterable[str], arrival: float) -> GraphSnapshot:
    """Return the snapshot with the names of all nodes in the graph, seen at `arrival` [s].

    A node that left and never reported is left out: a command that looked at the graph. The
    supervisor reports a node of the graph that ends before its first report.
    """
    shown = set(names)
    stays = {
        name: report
        for name, report in now.health.items()
        if name in shown or report.level is not Level.QUIET
    }
    health = {name: Health(Level.QUIET, 'running', arrival) for name in shown} | stays
    for name, report in health.items():
        if name in shown or report.present:
            health[name] = replace(report, present=name in shown)
    return replace(now, health=_newest_nodes(health))
