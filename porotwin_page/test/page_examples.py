"""Data that arrive at the page in a short experiment on the paper's small rig."""

import math
from dataclasses import replace
from functools import reduce
from pathlib import Path

import numpy as np

from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.rates.wells import WellRate, WellRates
from porotwin_core.rig import load_rig
from porotwin_page import graph_snapshot as snapshot
from porotwin_page.expectation import Expectation
from porotwin_page.graph_snapshot import (
    CyclePoint,
    GraphSnapshot,
    Map,
    ObservedState,
    Setpoint,
)
from porotwin_page.json_values import Json
from porotwin_page.panel import Moment
from porotwin_page.panel_registry import all_panels

RIG_FILE = Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml'
RIG = load_rig(RIG_FILE)
GRID = RIG.grid(12, 7)
START = 1_700_000_000.0
TOKEN = 'k7mq-3xwd-p9ra'


def rates(control1: float, control2: float = 0.0) -> dict[str, WellRate]:
    """Return the rates of every well for control rates in ml/h."""
    values = {
        'injector': 500.0,
        'producer': -(500.0 + control1 + control2),
        'control1': control1,
        'control2': control2,
        'control3': 0.0,
    }
    tracer = {'injector': 1.0}
    return {well: WellRate(from_ml_h(rate), tracer.get(well, 0.0)) for well, rate in values.items()}


def ml_h(rates: WellRates) -> dict[str, float]:
    """Return rates by well in ml/h, as a browser sends them."""
    return {well: round(to_ml_h(rate.rate), 6) for well, rate in rates.items()}


def map_at(time: float, value: float = 0.25) -> Map:
    """Return a uniform map."""
    return Map(time, np.full(GRID.shape, value), GRID)


def observed_state(
    sequence: int, *, value: float = 0.25, arrival: float | None = None
) -> ObservedState:
    """Return the state of photograph `sequence`, one every 30 s; it arrives when it is taken."""
    after = 30.0 * (sequence - 1)
    return ObservedState(
        sequence=sequence,
        map=map_at(START + after, value),
        arrival=after if arrival is None else arrival,
        time_step=30.0 if sequence > 1 else 0.0,
    )


def setpoint(sequence: int, control1: float) -> Setpoint:
    """Return the setpoint for photograph `sequence`; it arrives when the photograph is taken."""
    time = START + 30.0 * (sequence - 1)
    return Setpoint(
        sequence, time, time + 90.0, rates(control1), 'least tracer', arrival=time, clock=time
    )


def expectation(scale: float = 1.0, control1: float = 120.0) -> Expectation:
    """Return a forecast over 20 min, its tracer in the zone times `scale`."""
    tracer = scale * np.array([[0.0, 1e-6], [1e-6, 2e-6], [2e-6, 4e-6]])
    return Expectation(
        time=START + 30.0,
        rates=rates(control1),
        times=np.array([600.0, 1200.0]),
        zone_tracer=tracer,
        zone_reached=np.array([0.5, 1.0]),
        outline_time=1200.0,
        outlines=([(0.1, 0.1), (0.5, 0.1), (0.5, 0.4), (0.1, 0.1)],),
        now=([(0.1, 0.1), (0.3, 0.1), (0.3, 0.3), (0.1, 0.1)],),
    )


def point(sequence: int, error: float = 0.1) -> CyclePoint:
    """Return the report of the cycle of photograph `sequence`."""
    return CyclePoint(
        time=START + 30.0 * (sequence - 1),
        prediction_error=error,
        corrected_error=error / 2,
        disallowed_tracer=2e-6,
        cycle_duration=1.5,
        corrected=True,
    )


def after(*steps: tuple) -> GraphSnapshot:
    """Return the empty snapshot after `steps`: (function, arguments..., optional dict)."""

    def apply(now: GraphSnapshot, step: tuple) -> GraphSnapshot:
        function, *arguments = step
        named = arguments.pop() if arguments and isinstance(arguments[-1], dict) else {}
        return function(now, *arguments, **named)

    return reduce(apply, steps, GraphSnapshot())


def two_cycles() -> GraphSnapshot:
    """Return the snapshot after two photographs, the second 0.2 above its forecast."""
    return after(
        (replace, {'rig': RIG}),
        (snapshot.with_observed_state, observed_state(1)),
        (snapshot.with_predicted, map_at(START + 30.0, 0.30)),
        (snapshot.with_corrected, map_at(START + 30.0, 0.25)),
        (snapshot.with_setpoint, setpoint(1, 100.0)),
        (snapshot.with_cycle, point(1, math.nan)),
        (snapshot.with_observed_state, observed_state(2, value=0.45)),
        (snapshot.with_predicted, map_at(START + 60.0, 0.5)),
        (snapshot.with_corrected, map_at(START + 60.0, 0.4)),
        (snapshot.with_setpoint, setpoint(2, 120.0)),
        (snapshot.with_cycle, point(2)),
    )


def content(
    panel: str, now: GraphSnapshot, *, graph: float | None = None, steady: float = 0.0
) -> Json:
    """Return the content of a panel at a time on the graph's and the machine's clock [s]."""
    return all_panels()[panel].content(now, Moment(graph, steady))
