"""The forecast for the next photograph."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import MapPanel, Region, ShownMap


def newest_forecast(snapshot: GraphSnapshot) -> ShownMap | None:
    """Return the newest forecast, and whether it was corrected; None before the first one."""
    shown = snapshot.forecast
    if shown is None:
        return None
    corrected = bool(snapshot.history) and snapshot.history[-1].corrected
    note = 'corrected' if corrected else 'not corrected'
    return ShownMap(shown.concentration, shown.time, shown.number, notes=(note,))


PANEL = MapPanel(
    title='Forecast',
    region=Region.MAPS,
    order=20,
    shown=newest_forecast,
    empty='no forecast yet',
    time_prefix='for',
)
