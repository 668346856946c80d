"""Tests of the store of snapshots, also over a long run: its memory is steady."""

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
from page_examples import RIG, START, point, rates

from porotwin_page import graph_snapshot as snapshot
from porotwin_page.curve_history import history_view
from porotwin_page.event import event_view
from porotwin_page.graph_snapshot import (
    CyclePoint,
    GraphSnapshot,
    Health,
    Level,
    Map,
    ObservedState,
    Setpoint,
)
from porotwin_page.panel import Moment
from porotwin_page.panel_registry import all_panels
from porotwin_page.past_states import PastStates
from porotwin_page.snapshot_store import SnapshotStore

FIRST_HOUR = 120
"""Cycles of 30 s in an hour."""

BYTES_PER_CYCLE = 800
"""A point of the curves with the rates of 5 wells; everything else is bounded sooner."""


def feed(store: SnapshotStore, past: PastStates, cycles: range) -> None:
    """Send the messages of `cycles`, as the graph sends them, and read the page after each."""
    grid, random = RIG.grid(24, 14), np.random.default_rng(7)
    for k in cycles:
        time = START + 30.0 * k
        maps = [Map(time + 30.0 * i, random.random(grid.shape), grid) for i in (0, 1, 1)]
        state = ObservedState(k, maps[0], arrival=30.0 * k, remarks=(f'remark {k}',))
        setpoint = Setpoint(
            k, time, time + 90.0, rates(random.random()), f'reason {k}', arrival=time, clock=time
        )
        cycle = CyclePoint(time, *random.random(4), correction_status=f'status {k % 2}')
        store.update(snapshot.with_observed_state, state)
        past.add(store.snapshot)
        store.update(snapshot.with_predicted, maps[1])
        store.update(snapshot.with_corrected, maps[2])
        store.update(snapshot.with_setpoint, setpoint)
        store.update(snapshot.with_measured, rates(random.random()), by_person=True, clock=time)
        store.update(snapshot.with_confirmation, k)
        store.update(snapshot.with_cycle, cycle)
        store.update(snapshot.with_health, 'hub', Health(Level.OK, f'state {k}', 30.0 * k))
        event_view(store.snapshot, Moment(time, 30.0 * k), all_panels())
        history_view(store.snapshot, all_panels(), after=k - 1)


def test_memory_after_the_first_hour_grows_by_the_points_of_the_curves_alone() -> None:
    store, past = SnapshotStore(), PastStates()
    store.update(replace, rig=RIG)
    tracemalloc.start()
    try:
        feed(store, past, range(1, FIRST_HOUR + 1))
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        more = 2 * FIRST_HOUR
        feed(store, past, range(FIRST_HOUR + 1, FIRST_HOUR + 1 + more))
        gc.collect()
        growth = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
        past.close()
    assert growth < BYTES_PER_CYCLE * more
    assert len(store.snapshot.history) == FIRST_HOUR + more


def test_every_update_is_counted_and_leaves_old_snapshots_unchanged() -> None:
    store = SnapshotStore()
    before = store.snapshot
    store.update(snapshot.with_cycle, point(1))
    assert store.revision == 1
    assert before == GraphSnapshot()
    assert len(store.snapshot.history) == 1
