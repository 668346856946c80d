"""The log of setpoints: commands, expiries, and the reports of a person."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.json_values import Json, finite, rates_ml_h
from porotwin_page.panel import Moment, Region, ScriptPanel


def log_view(snapshot: GraphSnapshot, _: Moment) -> list[Json]:
    """Return the newest lines first: clock time, event, number of the setpoint, rates in ml/h."""
    return [
        {
            'clock_s': finite(line.clock, 13),
            'event': line.event.value,
            'sequence': line.sequence,
            'rates_ml_h': rates_ml_h(line.rates),
        }
        for line in reversed(snapshot.log)
    ]


PANEL = ScriptPanel(title='Log of setpoints', region=Region.STATUS, order=20, view=log_view)
