"""Remarks of imaging and hub about the newest cycle."""

from porotwin_page.graph_snapshot import GraphSnapshot
from porotwin_page.panel import LinesPanel, Moment, Region
from porotwin_page.panels.costa_gate import NO_MODEL

NOT_CALIBRATED = 'not calibrated: the scale of the concentration is a default'


def remarks(snapshot: GraphSnapshot, _: Moment) -> list[str]:
    """Return all remarks about the newest photograph and its forecast."""
    state = snapshot.observed
    cycle = snapshot.history[-1] if snapshot.history else None
    lines = [*(state.remarks if state else ()), *(cycle.remarks if cycle else ())]
    if state and not state.calibrated and not any('calibrat' in line.lower() for line in lines):
        lines.append(NOT_CALIBRATED)
    if cycle and not cycle.corrected and cycle.correction_status not in ('', NO_MODEL):
        lines.append(f'forecast not corrected: {cycle.correction_status}')
    return lines


PANEL = LinesPanel(title='', region=Region.MAPS, order=90, lines=remarks)
