"""Messages of the siblings: photographs and rates in, forecasts out."""

from typing import Any

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.ros import conversions
from porotwin_msgs.msg import Forecast, NewState
from porotwin_siblings.outlook import Outlook
from porotwin_siblings.photograph import Photograph


def photograph_from_msg(message: NewState, map_grid: Grid) -> Photograph:
    """Return the map of a state, which must lie on `map_grid` and show something.

    Raises:
        InputError: its map, its noise or its deviations are wrong.
    """
    values, grid = conversions.tracer_from_msg(message.tracer)
    deviation = conversions.deviation_from_msg(message.deviation, grid)
    systematic = conversions.deviation_from_msg(message.systematic, grid)
    if grid != map_grid:
        raise InputError(f'its map is {grid}, the siblings work on {map_grid}')
    if message.noise < 0.0 or np.isinf(message.noise):
        raise InputError(f'its noise is {message.noise:g}; send 0 or more, NaN when not known')
    time = conversions.time_from_msg(message.header.stamp)
    photograph = Photograph.of(time, values, deviation, systematic)
    photograph.check()
    return photograph


def forecast_to_msg(outlook: Outlook, grid: Grid, water: str) -> Forecast:
    """Return the message of an outlook with maps on `grid`, and `water` at its start in words."""
    start = outlook.start
    low, median, high = range(3)

    def maps(values: FloatArray) -> list[Any]:
        return [
            conversions.tracer_to_msg(one, grid, start + float(time))
            for one, time in zip(values, outlook.map_times, strict=True)
        ]

    return Forecast(
        header=conversions.header_at(start),
        schedule=conversions.plan_to_msg(outlook.plan),
        times=[conversions.duration_to_msg(time) for time in outlook.times],
        zone_tracer=outlook.zone_tracer[median].tolist(),
        zone_tracer_low=outlook.zone_tracer[low].tolist(),
        zone_tracer_high=outlook.zone_tracer[high].tolist(),
        zone_area=outlook.zone_area[median].tolist(),
        zone_area_low=outlook.zone_area[low].tolist(),
        zone_area_high=outlook.zone_area[high].tolist(),
        zone_reached=outlook.zone_reached.tolist(),
        map_times=[conversions.duration_to_msg(time) for time in outlook.map_times],
        water=water,
        mean=maps(outlook.mean),
        deviation=maps(outlook.deviation),
    )
