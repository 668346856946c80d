"""The health of all nodes, errors first."""

from porotwin_page.health import nodes_view
from porotwin_page.panel import Region, ScriptPanel

PANEL = ScriptPanel(
    title='Nodes',
    region=Region.STATUS,
    order=10,
    view=lambda snapshot, moment: nodes_view(snapshot, moment.steady),
)
