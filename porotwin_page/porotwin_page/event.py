"""The event for a browser: a snapshot in the units and words of people, ready for JSON.

Numbers that are not finite become null, which the page shows as a dash.
"""

from collections.abc import Mapping

import numpy as np

from porotwin_core.rig import Rig
from porotwin_core.rig.control_zones import control_zones
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.header import header_view
from porotwin_page.json_values import Json, finite, rates_ml_h
from porotwin_page.panel import MapPanel, Moment, Panel


def rig_view(rig: Rig) -> Json:
    """Return the geometry that is drawn over maps, in metres."""
    return {
        'width_m': rig.width_m,
        'height_m': rig.height_m,
        'wells': [{'name': name, 'x_m': w.x_m, 'z_m': w.z_m} for name, w in rig.wells.items()],
        'zones': [
            {'kind': kind, 'outlines_m': [np.round(line, 4).tolist() for line in zone.outlines]}
            for kind, zone in control_zones(rig)
        ],
    }


def past_view(snapshot: GraphSnapshot, panels: Mapping[str, Panel]) -> Json:
    """Return number, time and maps of an earlier state, which `snapshot` holds as its newest."""
    state = snapshot.observed
    moment = Moment(None, 0.0)
    return {
        'sequence': state.sequence if state else None,
        'time_s': finite(state.map.time, 15) if state else None,
        'rates_ml_h': rates_ml_h(snapshot.setpoint.rates) if snapshot.setpoint else {},
        'panels': {
            name: panel.content(snapshot, moment)
            for name, panel in panels.items()
            if isinstance(panel, MapPanel)
        },
    }


def event_view(snapshot: GraphSnapshot, moment: Moment, panels: Mapping[str, Panel]) -> Json:
    """Return all data except the curves: header, rig, rates, interruptions, panel contents."""
    return {
        'start_s': snapshot.start,
        'header': header_view(snapshot, moment.steady),
        'rig': rig_view(snapshot.rig) if snapshot.rig else None,
        'rates_ml_h': rates_ml_h(snapshot.orders(moment.graph)),
        'marks': [{'time_s': mark.time, 'reason': mark.reason} for mark in snapshot.marks],
        'panels': {name: panel.content(snapshot, moment) for name, panel in panels.items()},
    }
