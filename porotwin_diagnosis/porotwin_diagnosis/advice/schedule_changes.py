"""Schedules for a next experiment, made from the schedule of a recording."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from porotwin_core.rates.wells import ScheduleRow, WellRate
from porotwin_diagnosis.data.sample import Sample

REST_FROM = 0.4
"""Start of the rest, as a fraction of the duration: the plume has grown by then, and enough time
remains for it to change by itself."""

CHASE_FROM = 0.5
"""Start of the injection of water without tracer, as a fraction of the duration."""


@dataclass(frozen=True)
class ScheduleChange:
    """A change of the schedule that may separate two explanations.

    `apply` returns the sample with the changed schedule and times, or None if the change does not
    suit its rig.
    """

    name: str
    description: str
    apply: Callable[[Sample], Sample | None]


def _with(sample: Sample, rows: list[ScheduleRow]) -> Sample:
    return replace(sample, schedule=replace(sample.schedule, rows=tuple(rows)))


def _at_rates(factor: float) -> Callable[[Sample], Sample]:
    """Return a change that pumps the same volumes `factor` times as fast."""

    def change(sample: Sample) -> Sample:
        rows = [
            ScheduleRow(
                row.time / factor,
                row.well,
                WellRate(row.rate.rate * factor, row.rate.concentration),
            )
            for row in sample.schedule.rows
        ]
        return replace(
            _with(sample, rows),
            times=sample.times / factor,
            start=sample.start / factor,
            held_out_start=sample.held_out_start / factor,
            end=sample.end / factor,
        )

    return change


def _rest(sample: Sample) -> Sample:
    """Return `sample` with all pumps stopped from `REST_FROM` of its duration on."""
    stop = sample.start + REST_FROM * sample.duration
    rows = [row for row in sample.schedule.rows if row.time < stop]
    rows += [ScheduleRow(stop, well, WellRate()) for well in sample.schedule.wells]
    return _with(sample, rows)


def _chase(sample: Sample) -> Sample:
    """Return `sample` with water instead of tracer from `CHASE_FROM` of its duration on."""
    begin = sample.start + CHASE_FROM * sample.duration
    rows = [
        ScheduleRow(row.time, row.well, WellRate(row.rate.rate, 0.0)) if row.time >= begin else row
        for row in sample.schedule.rows
    ]
    for well, rate in sample.schedule.at(begin).items():
        if rate.rate > 0:
            rows.append(ScheduleRow(begin, well, WellRate(rate.rate, 0.0)))
    return _with(sample, rows)


def _one_well_at_a_time(sample: Sample) -> Sample | None:
    """Return `sample` with every pumping well alone for an equal time, tracer first.

    Each well pumps its largest commanded rate. If only one well pumps, water follows through the
    nearest other well. In a closed rig the injectors take turns, and the producers take out as much
    as is injected. None where only one well can pump.
    """
    largest = sample.schedule.largest
    closed = sample.rig.closed
    producing = {well: rate.rate for well, rate in largest.items() if rate.rate < 0}
    turns = [(well, rate) for well, rate in largest.items() if rate.rate > 0 or not closed]
    if len(turns) == 1 and not closed and len(sample.rig.wells) > 1:
        well, rate = turns[0]
        turns.append((_nearest_well(sample, well), WellRate(abs(rate.rate))))
    if len(turns) < 2 or (closed and not producing):
        return None
    turns.sort(key=lambda turn: (-turn[1].concentration, -turn[1].rate))
    rows = []
    for number, (well, rate) in enumerate(turns):
        rates = dict.fromkeys([*largest, *dict(turns)], WellRate()) | {well: rate}
        if closed:
            share = rate.rate / sum(producing.values())
            rates |= {name: WellRate(-share * out) for name, out in producing.items()}
        begin = sample.start + sample.duration * number / len(turns)
        rows += [ScheduleRow(begin, name, value) for name, value in rates.items()]
    return _with(sample, rows)


def _nearest_well(sample: Sample, name: str) -> str:
    """Return the well nearest to the well `name`."""
    wells = sample.rig.wells
    here = wells[name]
    others = [other for other in wells if other != name]
    return min(
        others, key=lambda other: np.hypot(wells[other].x_m - here.x_m, wells[other].z_m - here.z_m)
    )


SCHEDULE_CHANGES: tuple[ScheduleChange, ...] = (
    ScheduleChange(
        'rest',
        'stop all pumps after 40 % of the time and go on photographing: diffusion, buoyancy and '
        'decay go on, dispersion and wrong rates stop',
        _rest,
    ),
    ScheduleChange(
        'half rates', 'pump the same volumes at half the rates, in twice the time', _at_rates(0.5)
    ),
    ScheduleChange(
        'double rates', 'pump the same volumes at twice the rates, in half the time', _at_rates(2.0)
    ),
    ScheduleChange('water after tracer', 'inject water without tracer in the second half', _chase),
    ScheduleChange(
        'one well at a time',
        'let every pump run alone in turn, those with tracer first (after a single pump, inject '
        'water through the nearest other well): an error at one well shows in its turn only, an '
        'error of the sand shows in every turn',
        _one_well_at_a_time,
    ),
)
"""All changes that are tried."""
