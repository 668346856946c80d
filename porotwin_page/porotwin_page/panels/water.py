"""Where water enters and leaves, by well, side and sand, under the present rates."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import LinesPanel, Moment, Region


def lines(snapshot: GraphSnapshot, _: Moment) -> list[str]:
    """Return the balance in a line for wells and sides, and one for the sands; none before it."""
    told = snapshot.expected.water if snapshot.expected is not None else ''
    return told.split('; ') if told else []


PANEL = LinesPanel(title='Water', region=Region.STATUS, order=40, lines=lines)
