"""A check of finished maps: they cannot hold more tracer than the pumps injected."""

import numpy as np

from porotwin_core.basis.units import ML
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule
from porotwin_core.rig import Rig

MOST_EXCESS = 1.5
"""Tracer in a map over the injected tracer above which the description must be wrong. Calibrated
maps of a rightly described rig keep within a tenth."""

LEAST_SHARE = 0.01
"""Share of the pore volume below which an excess may be the noise of clean sand."""


def stock_in_map(values: FloatArray, rig: Rig) -> float:
    """Return the volume of stock [m^3] in a map of concentration (nz, nx) [-]; NaN counts as 0."""
    rows, columns = values.shape
    return float(np.nansum(values * rig.cell_pore_volume(rig.grid(columns, rows))))


def excess_remark(values: FloatArray, time: float, rig: Rig, schedule: Schedule) -> str:
    """Return what is wrong if a map holds much more tracer than was injected; '' if it does not.

    Tracer may leave through a well or the top, so too little tracer is no contradiction.

    Args:
        values: concentration (nz, nx) [-]; NaN counts as 0.
        time: time of the map [s].
        rig: the rig; its depth, porosity and size give the pore volume.
        schedule: the injected rates.
    """
    if not schedule.rows:
        return ''
    held = stock_in_map(values, rig)
    injected = schedule.injected_stock(-np.inf, time)
    if held - injected < LEAST_SHARE * rig.pore_volume or held < MOST_EXCESS * injected:
        return ''
    return (
        f'the map at {time:.0f} s holds {held * ML:.3g} ml of tracer stock, but the pumps '
        f'injected {injected * ML:.3g} ml; check the sizes, the depth and the porosity in '
        'rig.yaml, the rates, the times in imaging.csv, and whether the calibration is of this rig'
    )
