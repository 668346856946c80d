"""Tests of the registry: it finds every panel, and every script panel has its script."""

from collections import Counter

from porotwin_page.panel import Panel, ScriptPanel
from porotwin_page.panel_registry import all_panels
from porotwin_page.web_files import web_files


def test_all_panels_are_found_and_sorted_by_order() -> None:
    panels = all_panels()
    assert {'pump_settings', 'observed', 'remarks', 'forecast_error', 'node_health'} <= set(panels)
    assert all(isinstance(panel, Panel) for panel in panels.values())
    orders = [panel.order for panel in panels.values()]
    assert orders == sorted(orders)


def test_panels_of_one_region_have_different_orders() -> None:
    places = Counter((panel.region, panel.order) for panel in all_panels().values())
    assert max(places.values()) == 1


def test_every_script_panel_has_its_script() -> None:
    scripts = {path for path in web_files() if path.startswith('panels/')}
    needed = {f'panels/{name}.js' for name, p in all_panels().items() if isinstance(p, ScriptPanel)}
    assert scripts == needed
