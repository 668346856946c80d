"""The time from every state to its setpoint."""

from porotwin_page.panel import ChartPanel, Region

PANEL = ChartPanel(
    title='Duration of a cycle',
    region=Region.CURVES,
    order=40,
    values=lambda cycle: {'': cycle.cycle_duration},
    unit='s',
)
