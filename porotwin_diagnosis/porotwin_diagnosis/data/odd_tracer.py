"""Looks for oddities of the tracer in the maps of a recording."""

from collections.abc import Iterator, Sequence

import numpy as np

from porotwin_core.basis.plausibility import Remark
from porotwin_core.checks.mass_check import excess_remark
from porotwin_core.rates.wells import Schedule
from porotwin_diagnosis.data.observed_maps import VISIBLE_TRACER
from porotwin_diagnosis.data.odd_maps import (
    looked_at,
    remark_about_maps,
    remarks_about_cells,
    remarks_about_clean_sand,
    remarks_about_order,
)
from porotwin_diagnosis.data.odd_places import remarks_about_places
from porotwin_diagnosis.data.odd_start import (
    remarks_about_early_tracer,
    remarks_about_first_plume,
)
from porotwin_recording.experiment.odd_recording import (
    remarks_about_maps,
    remarks_about_measured_rates,
    remarks_about_times,
)
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.concentration import ConcentrationMaps


def odd_lines(recordings: Sequence[Recording]) -> list[str]:
    """Return a line for all that is odd in the measured rates and the tracer of `recordings`.

    Raises:
        InputError: a recording holds no maps.
    """
    return [
        f'{recording.source}: {remark}'
        for recording in recordings
        for remark in (*remarks_about_measured_rates(recording), *remarks_about_tracer(recording))
    ]


def odd_times(recordings: Sequence[Recording]) -> list[str]:
    """Return a line for all that is odd in the times of `recordings`; opening them told it."""
    return [
        f'{recording.source}: {remark}'
        for recording in recordings
        for remark in remarks_about_times(recording)
    ]


def remarks_about_tracer(recording: Recording) -> Iterator[Remark]:
    """Yield the remarks about the tracer in the maps of `recording`.

    Raises:
        InputError: the recording holds no maps.
    """
    yield from remarks_about_maps(recording)
    maps, rates = recording.present_maps, recording.known_rates
    yield from remarks_about_order(maps, rates)
    yield from remarks_about_clean_sand(maps)
    chosen = looked_at(len(maps))
    yield from remarks_about_cells(recording.rig, maps, chosen)
    if rates is None:
        return

    def excess(index: int) -> str:
        return excess_remark(maps[index], float(maps.times[index]), recording.rig, rates)

    if told := excess(0):
        yield from remarks_about_early_tracer(recording, rates, told)
        return
    yield from remarks_about_first_plume(recording, rates)
    yield from list(map(remark_about_maps, filter(None, map(excess, chosen))))[:1]
    yield from remarks_about_places(recording.rig, maps, rates, chosen)
    yield from _none_seen(maps, rates, chosen)


def _none_seen(maps: ConcentrationMaps, rates: Schedule, chosen: Sequence[int]) -> Iterator[Remark]:
    """Yield a remark if most of the `chosen` maps show no tracer while stock is injected."""
    stock = [row.time for row in rates.rows if row.rate.rate > 0 and row.rate.concentration > 0]
    later = [
        index
        for index in chosen
        if stock and maps.times[index] > stock[0] and np.isfinite(maps[index]).any()
    ]
    empty = [index for index in later if not np.any(maps[index] > VISIBLE_TRACER)]
    if 2 * len(empty) > len(later):
        yield remark_about_maps(
            f'{len(empty)} of {len(later)} maps that were looked at show no tracer, but stock is '
            f'injected from {stock[0]:g} s on; compare the clocks of camera and pumps'
        )
