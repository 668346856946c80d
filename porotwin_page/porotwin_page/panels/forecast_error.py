"""The error of every forecast, with and without correction, beside the expected one."""

import math

from porotwin_page.graph_snapshot import CyclePoint
from porotwin_page.panel import ChartPanel, Region


def errors(cycle: CyclePoint) -> dict[str, float]:
    """Return the relative errors in percent; the corrected one is NaN without a correction.

    `expected` is the error from the deviations of maps and forecasts. An error far above `expected`
    shows a change in the rig.
    """
    corrected = cycle.corrected_error if cycle.corrected else math.nan
    return {
        'corrected': 100 * corrected,
        'model alone': 100 * cycle.prediction_error,
        'expected': 100 * cycle.expected_error,
    }


PANEL = ChartPanel(
    title='Forecast error',
    region=Region.CURVES,
    order=10,
    values=errors,
    unit='%',
    dashed=('model alone', 'expected'),
)
