"""The newest observed map minus the forecast for its time."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.map_pictures import difference_limit
from porotwin_page.panel import MapPanel, Region, ShownMap


def newest_difference(snapshot: GraphSnapshot) -> ShownMap | None:
    """Return the difference on a symmetric scale; None without a forecast for the photograph."""
    if snapshot.observed is None or snapshot.difference is None:
        return None
    observed = snapshot.observed.map
    limit = difference_limit(snapshot.difference)
    return ShownMap(snapshot.difference, observed.time, observed.number, low=-limit, high=limit)


PANEL = MapPanel(
    title='Observed − forecast',
    region=Region.MAPS,
    order=30,
    shown=newest_difference,
    quantity='difference',
    empty='no pair of maps yet',
)
