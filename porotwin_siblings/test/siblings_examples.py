"""A small rig and its courses, for the tests of the siblings."""

from pathlib import Path

import numpy as np

from porotwin_core.basis.units import from_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRate
from porotwin_core.rig import load_rig
from porotwin_siblings.photograph import Photograph

RIG = load_rig(Path(__file__).resolve().parents[2] / 'porotwin_hub' / 'config' / 'small_rig.yaml')
GRID = RIG.grid(24, 14)
"""Cells of 4 cm: a course of an hour takes milliseconds."""

RATES = {
    'injector': WellRate(from_ml_h(500.0), 1.0),
    'control1': WellRate(from_ml_h(300.0)),
    'producer': WellRate(from_ml_h(-800.0)),
}


def period(start: float, end: float) -> RatePeriod:
    """Return the usual rates from `start` to `end` [s]."""
    return RatePeriod(start, end, RATES)


def photograph(time: float, concentration: FloatArray) -> Photograph:
    """Return a good photograph of `concentration` (nz, nx) at `time` [s]."""
    clear = np.full(concentration.shape, 0.004)
    return Photograph(time, concentration, clear, 0.02 * concentration)


EMPTY = np.zeros(GRID.shape)
