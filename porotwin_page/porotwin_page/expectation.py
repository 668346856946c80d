"""Forecasts of the siblings: tracer in the zone with a band, and outlines of the plume."""

from dataclasses import dataclass

import contourpy
import numpy as np

from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.model.tracer_share import PLUME_THRESHOLD
from porotwin_core.rates.wells import WellRates
from porotwin_page.json_values import Json, finite, rates_ml_h

OUTLINE_DIGITS = 3
"""Digits of places in metres: a millimetre is finer than a pixel."""

Outline = list[tuple[float, float]]
"""Corners (x, z) [m] of a part of the outline of a plume."""


@dataclass(frozen=True)
class Expectation:
    """A forecast of the siblings under one plan of rates.

    Attributes:
        time: time of its initial state [s].
        rates: rates of the wells at its start [m^3/s].
        times: times after that state [s], (nt,).
        zone_tracer: tracer in the disallowed zone [m^3], (3, nt): 5 %, median, 95 %.
        zone_reached: probability that tracer has reached the zone [-], (nt,).
        outline_time: time after the state [s] of `outlines`.
        outlines: outlines of the mean plume at `outline_time`.
        now: outlines of the plume of the newest photograph.
        water: rates of the water at the start by well, side and sand, in words.
        note: what the siblings remark on the question, in one line.
    """

    time: float
    rates: WellRates
    times: FloatArray
    zone_tracer: FloatArray
    zone_reached: FloatArray
    outline_time: float
    outlines: tuple[Outline, ...] = ()
    now: tuple[Outline, ...] = ()
    water: str = ''
    note: str = ''


def plume_outlines(concentration: FloatArray, grid: Grid) -> tuple[Outline, ...]:
    """Return the outlines of the plume in a map (nz, nx); unseen cells (NaN) count as empty.

    The map is surrounded by water, so that every outline is closed.
    """
    values = np.pad(np.nan_to_num(np.asarray(concentration, dtype=float)), 1)
    x = np.concatenate([[0.0], grid.x, [grid.width]])
    z = np.concatenate([[0.0], grid.z, [grid.height]])
    lines = contourpy.contour_generator(x, z, values).lines(PLUME_THRESHOLD)
    return tuple(
        [(round(float(a), OUTLINE_DIGITS), round(float(b), OUTLINE_DIGITS)) for a, b in line]
        for line in lines
        if isinstance(line, np.ndarray)
    )


def expectation_view(expectation: Expectation) -> Json:
    """Return an expectation for a browser: minutes, ml, percent, metres."""
    low, median, high = (
        [finite(ML * float(value)) for value in row] for row in expectation.zone_tracer
    )
    return {
        'time_s': finite(expectation.time, 15),
        'rates_ml_h': rates_ml_h(expectation.rates),
        'minutes': [finite(float(time) / 60.0) for time in expectation.times],
        'zone_ml': {'low': low, 'median': median, 'high': high},
        'reached_percent': [finite(100.0 * float(share)) for share in expectation.zone_reached],
        'outline_minutes': finite(expectation.outline_time / 60.0),
        'outlines': [list(outline) for outline in expectation.outlines],
        'now': [list(outline) for outline in expectation.now],
        'note': expectation.note,
    }
