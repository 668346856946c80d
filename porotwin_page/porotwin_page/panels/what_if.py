"""Forecasts with the present and with proposed rates; this panel pumps nothing."""

from porotwin_page.expectation import expectation_view
from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json
from porotwin_page.panel import Moment, Region, ScriptPanel


def what_if_view(snapshot: GraphSnapshot, _: Moment) -> Json | None:
    """Return the forecast with the present rates, and the control wells with their limits.

    None before the first forecast: the siblings do not run, or no photograph has come.
    """
    if snapshot.expected is None:
        return None
    control = snapshot.rig.control if snapshot.rig is not None else None
    return {
        'present': expectation_view(snapshot.expected),
        'wells': list(control.wells) if control is not None else [],
        'max_rate_ml_h': control.max_rate_ml_h if control is not None else 0.0,
        'max_total_ml_h': control.most_total_ml_h if control is not None else 0.0,
        'step_ml_h': control.rate_step_ml_h if control is not None else 0.0,
        'controlled': snapshot.setpoint is not None,
    }


PANEL = ScriptPanel(
    title='What to expect, and what if', region=Region.MAPS, order=40, view=what_if_view
)
