"""The points of all curves, sent to every browser once."""

from collections.abc import Mapping

from porotwin_page.graph_snapshot import CyclePoint, GraphSnapshot
from porotwin_page.json_values import Json
from porotwin_page.panel import ChartPanel, Panel


def point_view(point: CyclePoint, panels: Mapping[str, Panel]) -> Json:
    """Return one cycle: its time, and the values of all charts among `panels` by name."""
    values = {
        name: panel.point(point) for name, panel in panels.items() if isinstance(panel, ChartPanel)
    }
    return {'time_s': point.time, 'values': values}


def history_view(snapshot: GraphSnapshot, panels: Mapping[str, Panel], *, after: int) -> Json:
    """Return the points that a browser lacks.

    The last point is sent again, because its setpoint may arrive after its report.

    Args:
        snapshot: holds the points.
        panels: panels by name.
        after: number of points that the browser holds; -1 for none.

    Returns:
        `points`; `begin`, the number of the first point (the browser replaces all points from there
        on); `end`, the number of points ever added; `reset`, whether the browser first drops all
        its points, for a new experiment or if it has none.
    """
    first = snapshot.history_end - len(snapshot.history)
    # a browser that holds as many points as came before this experiment holds none of it
    earlier = after < snapshot.history_start or after == snapshot.history_start > 0
    reset = earlier or after < first or after > snapshot.history_end
    begin = first if reset else max(first, min(after, snapshot.history_end - 1))
    return {
        'reset': reset,
        'begin': begin,
        'end': snapshot.history_end,
        'points': [point_view(point, panels) for point in snapshot.history[begin - first :]],
    }
