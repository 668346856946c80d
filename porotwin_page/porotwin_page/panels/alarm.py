"""A red line about wrong publishers of setpoints."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import LinesPanel, Moment, Region


def alarms(snapshot: GraphSnapshot, _: Moment) -> list[str]:
    """Return the warning line, if any."""
    return [snapshot.alarm] if snapshot.alarm else []


PANEL = LinesPanel(title='', region=Region.ACTIONS, order=1, lines=alarms)
