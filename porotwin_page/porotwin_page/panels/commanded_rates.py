"""The commanded rates of all wells."""

from porotwin_page.json_values import rates_ml_h
from porotwin_page.panel import ChartPanel, Region

PANEL = ChartPanel(
    title='Commanded rates',
    region=Region.CURVES,
    order=30,
    values=lambda cycle: rates_ml_h(cycle.rates),
    unit='ml/h',
    steps=True,
    digits=0,
)
