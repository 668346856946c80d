"""The observed tracer in the disallowed zone."""

from porotwin_core.units import ML
from porotwin_page.panel import ChartPanel, Region

PANEL = ChartPanel(
    title='Tracer in the disallowed zone',
    region=Region.CURVES,
    order=20,
    values=lambda cycle: {'': ML * cycle.disallowed_tracer},
    unit='ml',
)
