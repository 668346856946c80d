"""The observed tracer where it must not be, or how far it is from a target."""

from porotwin_core.basis.units import ML
from porotwin_page.panel import ChartPanel, Region

PANEL = ChartPanel(
    title='Observed tracer',
    region=Region.CURVES,
    order=20,
    values=lambda cycle: {cycle.tracer_place: ML * cycle.disallowed_tracer},
    unit='ml',
)
