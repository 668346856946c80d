"""A part of a recording: its maps and photographs between two times."""

import math
from dataclasses import replace

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.rates.wells import Schedule
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps
from porotwin_recording.tables.rates import measured_to


def cut(recording: Recording, start: float, end: float) -> Recording:
    """Return the maps and photographs of a recording from `start` to `end` [s], both included.

    Times keep their zero. Rates before `start` stay, because they tell what was injected before.
    Baselines and dilutions stay too: they belong to the camera.

    Raises:
        InputError: nothing was recorded between these times.
    """
    maps = None if recording.maps is None else _maps_between(recording.maps, start, end)
    photos = tuple(
        photo for photo in recording.photos if photo.role != 'state' or start <= photo.time <= end
    )
    if not maps and not any(photo.role == 'state' for photo in photos):
        raise InputError(
            f'{recording.source}: no map and no photograph{_span_words(start, end)}; '
            f'{_recorded_time(recording)}'
        )
    return replace(
        recording,
        commanded=_until(recording.commanded, end),
        measured=_measured_until(recording.measured, end),
        maps=maps or None,
        photos=photos,
        readings=tuple(one for one in recording.readings if one.time <= end),
    )


def _span_words(start: float, end: float) -> str:
    """Return a span of time [s] in words; one end may be infinite."""
    begin = f' from {start:g} s on' if end == math.inf else f' from {start:g}'
    return begin if end == math.inf else f'{begin if start > -math.inf else ""} to {end:g} s'


def _maps_between(maps: ConcentrationMaps, start: float, end: float) -> ConcentrationMaps:
    first = np.searchsorted(maps.times, start, side='left')
    stop = np.searchsorted(maps.times, end, side='right')
    return maps.part(int(first), int(stop))


def _until(schedule: Schedule | None, end: float) -> Schedule | None:
    """Return the rows of a schedule that act before `end` [s]."""
    if schedule is None:
        return None
    return replace(schedule, rows=tuple(row for row in schedule.rows if row.time <= end))


def _measured_until(measured: Schedule | None, end: float) -> Schedule | None:
    """Return the rows of measured rates up to `end` [s], with one there if later ones follow.

    From the last measured row on commands count, and these rates were measured to `end`.
    """
    kept = _until(measured, end)
    if measured is None or kept is None or not kept.rows or kept.rows == measured.rows:
        return kept
    return measured_to(kept, end)


def _recorded_time(recording: Recording) -> str:
    """Return the times that a recording covers, in words."""
    times = [photo.time for photo in recording.photos if photo.role == 'state']
    times += [] if recording.maps is None else recording.maps.times.tolist()
    if not times:
        return 'it holds neither maps nor photographs'
    return f'it covers {min(times):g} to {max(times):g} s'
