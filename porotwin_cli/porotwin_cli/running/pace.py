"""Whether the live twin keeps pace with the camera on this machine."""

import logging

from porotwin_core.geometry.grid import Grid
from porotwin_core.rig import Rig
from porotwin_solver.model.prediction_cost import (
    in_words,
    prediction_cost,
    slowness_of_this_machine,
    working_rates,
)

LOG = logging.getLogger('porotwin')

MOST_OF_THE_INTERVAL = 0.25
"""Part of the time between photographs that a prediction may take; control needs many of them."""


def tell_pace(rig: Rig, grid: Grid, preset: str, photo_interval: float) -> None:
    """Log a warning if a prediction takes long beside `photo_interval` [s].

    A rig whose wells cannot pump without a control section is not judged.
    """
    if rig.control is None or not working_rates(rig):
        return
    cost = prediction_cost(rig, grid, preset=preset, duration=photo_interval)
    if cost.seconds < 0.1 * MOST_OF_THE_INTERVAL * photo_interval:
        return  # clear without a trial of this machine
    slowness = slowness_of_this_machine(rig, preset)
    seconds = slowness * cost.seconds
    if seconds > MOST_OF_THE_INTERVAL * photo_interval:
        LOG.warning(
            'a prediction takes about %s on the grid %s, and photographs come every %s; '
            'choose a coarser --grid or a longer --photo-interval-s',
            in_words(seconds),
            grid,
            in_words(photo_interval),
        )
