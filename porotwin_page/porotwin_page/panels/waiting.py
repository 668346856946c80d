"""The parts of the page that have no data yet."""

from porotwin_page.graph_snapshot import GraphSnapshot, Level
from porotwin_page.panel import LinesPanel, Moment, Region

CAMERAS = ('camera', 'virtual_rig')
"""Nodes that bring photographs."""


def waiting(snapshot: GraphSnapshot, _: Moment) -> list[str]:
    """Return a line for everything that has not arrived yet; none after the end."""
    if snapshot.finished is not None:
        return []
    lines = []
    if snapshot.preparation and snapshot.observed is None:
        lines.append(snapshot.preparation)
    if snapshot.rig is None:
        lines.append('the description of the rig, from the node hub')
    if snapshot.observed is None:
        lines.append(f'the first photograph, {_camera(snapshot)}')
    elif snapshot.forecast is None and not snapshot.history:
        lines.append('the first forecast, from the node solver')
    controlled = snapshot.rig is not None and snapshot.rig.control is not None
    if controlled and snapshot.setpoint is None and not snapshot.history:
        lines.append('the first setpoint, from the nodes hub and guard')
    return lines


def _camera(snapshot: GraphSnapshot) -> str:
    running = [
        name
        for name in CAMERAS
        if name in snapshot.health
        and snapshot.health[name].present is not False
        and snapshot.health[name].level is not Level.SILENT
    ]
    return f'from the node {running[0]}' if running else 'but no node brings photographs yet'


PANEL = LinesPanel(title='Waiting for', region=Region.ACTIONS, order=5, lines=waiting)
