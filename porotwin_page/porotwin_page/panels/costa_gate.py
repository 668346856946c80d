"""COSTA: the decision of its gate, and the benefit of the correction on the newest photographs."""

import math
from statistics import fmean

from porotwin_core.basis.units import percent
from porotwin_page.graph_snapshot import CyclePoint, GraphSnapshot, Level
from porotwin_page.panel import LinesPanel, Moment, Region

NODE = 'costa'
"""Name of the node that reports the decision of the gate as its health."""

NO_MODEL = 'no model loaded'
"""Its report without a model."""

NEWEST = 20
"""Cycles over which the gain is averaged: ten minutes of photographs every 30 s."""


def lines(snapshot: GraphSnapshot, _: Moment) -> list[str]:
    """Return the decision of the gate, its reason, and the errors with and without COSTA.

    The result is empty without a model.
    """
    report = snapshot.health.get(NODE)
    if report is None or report.level is Level.QUIET or report.message == NO_MODEL:
        return []
    told = [report.message]
    newest = snapshot.history[-NEWEST:]
    compared = [cycle for cycle in newest if _compared(cycle)]
    if compared:
        alone = fmean(cycle.prediction_error for cycle in compared)
        corrected = fmean(cycle.corrected_error for cycle in compared)
        count = len(compared)
        newest_ones = 'newest forecast' if count == 1 else f'newest {count} forecasts'
        told.append(
            f'{newest_ones}: error {percent(corrected, 1)}, {percent(alone, 1)} without COSTA'
        )
    if newest and not newest[-1].corrected:
        told.append(f'not applied now: {newest[-1].correction_status or "no reason given"}')
    return told


def _compared(cycle: CyclePoint) -> bool:
    errors = (cycle.prediction_error, cycle.corrected_error)
    return cycle.corrected and all(math.isfinite(error) for error in errors)


PANEL = LinesPanel(title='COSTA', region=Region.STATUS, order=15, lines=lines)
