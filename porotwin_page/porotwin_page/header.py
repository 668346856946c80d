"""The header of the page: rig, newest photograph, end of the experiment, worst node."""

from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S, VALIDITY_INTERVALS
from porotwin_page.graph_snapshot import GraphSnapshot, ObservedState
from porotwin_page.health import nodes_view, worst_view
from porotwin_page.json_values import Json, finite


def photo_view(snapshot: GraphSnapshot, state: ObservedState, steady: float) -> Json:
    """Return number, times and age of the newest photograph.

    Args:
        snapshot: the snapshot.
        state: its observed state.
        steady: present time on this machine's steady clock [s].
    """
    interval = snapshot.photo_interval or USUAL_PHOTO_INTERVAL_S
    age = steady - state.arrival
    return {
        'sequence': state.sequence,
        'time_s': state.map.time,
        'age_s': finite(age),
        'interval_s': finite(interval),
        'stale': snapshot.finished is None and age > VALIDITY_INTERVALS * interval,
    }


def header_view(snapshot: GraphSnapshot, steady: float) -> Json:
    """Return the content of the header; `steady` as in `photo_view`."""
    state = snapshot.observed
    return {
        'rig_name': snapshot.rig.name if snapshot.rig else '',
        'photo': photo_view(snapshot, state, steady) if state else None,
        'finished': snapshot.finished,
        'nodes': worst_view(nodes_view(snapshot, steady)),
    }
