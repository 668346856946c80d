"""Oddities of the first map of a recording beside the rates until then."""

from collections.abc import Iterator

import numpy as np

from porotwin_core.basis.plausibility import Remark
from porotwin_core.basis.units import ML
from porotwin_core.checks.mass_check import stock_in_map
from porotwin_core.rates.wells import Schedule
from porotwin_diagnosis.data.initial_tracer import LONGEST_LATENESS, initial_tracer
from porotwin_diagnosis.data.observed_maps import FILLED_SHARE
from porotwin_diagnosis.data.odd_maps import looked_at, remark_about_maps
from porotwin_diagnosis.data.plume_reach import tracer_beyond_reach
from porotwin_recording.experiment.recording import Recording

INVERTED_LEVEL = 0.5
"""Median of the first map [-] above which its values may be those of water."""

LEAST_INJECTED, LEAST_HELD = 0.02, 0.3
"""Share of the pore volume that was injected before the first map, and share of it in that map: a
plume that is hardly there was flushed, or its pump did not run."""

REVERSED_ERROR = 0.15
"""Largest difference of held and injected tracer, over the largest amount, of maps that are in
reversed order. Calibrated maps keep within a tenth."""


def remarks_about_early_tracer(
    recording: Recording, rates: Schedule, told: str
) -> Iterator[Remark]:
    """Yield a remark if the first map holds more tracer than was injected, as `told`."""
    maps = recording.present_maps
    inverted = np.nanmedian(maps[0]) > INVERTED_LEVEL
    start = float(maps.times[0])
    if inverted:
        yield remark_about_maps(f'{told}. If 1 is water in these maps, write 1 minus their values')
    elif _are_reversed(recording, rates):
        yield remark_about_maps(
            'the maps hold what the pumps injected if the last one comes first; correct their '
            'order or their times'
        )
    elif initial_tracer(recording) is None:
        yield remark_about_maps(
            f'the clock of the camera is late, or the rig held tracer before the recording: {told}'
        )
    elif rates.injected_stock(start, float(maps.times[-1])) > 0.0:
        yield remark_about_maps(
            f'the first map, at {start:g} s, holds tracer from before the recording, with which '
            'the model starts; if the rig was clean then, compare the clocks of camera and pumps'
        )


def _are_reversed(recording: Recording, rates: Schedule) -> bool:
    """Return whether the maps hold the injected tracer if the last one comes first."""
    maps = recording.present_maps
    backwards = looked_at(len(maps))[::-1]
    held = np.array([stock_in_map(maps[index], recording.rig) for index in backwards])
    times = maps.times[0] + maps.times[-1] - maps.times[backwards]
    injected = np.array([rates.injected_stock(-np.inf, float(time)) for time in times])
    largest = max(held.max(), injected.max())
    grown = injected[-1] - injected[0] > (1.0 - REVERSED_ERROR) * largest
    return bool(grown and np.abs(held - injected).max() < REVERSED_ERROR * largest)


def remarks_about_first_plume(recording: Recording, rates: Schedule) -> Iterator[Remark]:
    """Yield remarks if the plume of the first map is too small, or lies where no well reaches."""
    yield from _lost_before(recording, rates)
    yield from _beyond_reach(recording, rates)


def _lost_before(recording: Recording, rates: Schedule) -> Iterator[Remark]:
    """Yield a remark if the first map holds little of the stock that was injected before it."""
    maps, rig = recording.present_maps, recording.rig
    start = float(maps.times[0])
    injected = rates.injected_stock(-np.inf, start)
    held = stock_in_map(maps[0], rig)
    if injected > LEAST_INJECTED * rig.pore_volume and held < LEAST_HELD * injected:
        yield remark_about_maps(
            f'the first map, at {start:g} s, holds {held * ML:.3g} ml of tracer stock, but the '
            f'pumps injected {injected * ML:.3g} ml before it; if the rig was flushed, begin the '
            'rates after that'
        )


def _beyond_reach(recording: Recording, rates: Schedule) -> Iterator[Remark]:
    """Yield a remark if the first map shows tracer that no well can have brought there.

    The wells count with the volume that a clock may be late for.
    """
    maps = recording.present_maps
    start, end = float(maps.times[0]), float(maps.times[-1])
    far = tracer_beyond_reach(recording, rates, start + LONGEST_LATENESS * (end - start))
    x, z = np.meshgrid(maps.grid.x, maps.grid.z)
    if far.mean() > FILLED_SHARE:
        yield remark_about_maps(
            f'the first map, at {start:g} s, shows tracer around x = {x[far].mean():.3g} m, '
            f'z = {z[far].mean():.3g} m, where no well can have brought it yet; is it from before '
            'the recording, or a reflection? Begin with a clean rig, or take a new baseline'
        )
