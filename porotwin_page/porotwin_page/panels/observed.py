"""The map from the newest photograph."""

import numpy as np

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import MapPanel, Region, ShownMap


def newest_map(snapshot: GraphSnapshot) -> ShownMap | None:
    """Return the observed map with the percentage of unseen cells; None before a photograph."""
    if snapshot.observed is None:
        return None
    shown = snapshot.observed.map
    unseen = 100 * (1 - float(np.isfinite(shown.concentration).mean()))
    notes = (f'{unseen:.2g} % not seen (hatched)',) if unseen else ()
    return ShownMap(shown.concentration, shown.time, shown.number, notes=notes)


PANEL = MapPanel(
    title='Observed',
    region=Region.MAPS,
    order=10,
    shown=newest_map,
    unit='concentration, 1 = tracer stock',
    empty='no photograph yet',
    large=True,
)
