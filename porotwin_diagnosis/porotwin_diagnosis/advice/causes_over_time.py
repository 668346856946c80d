"""Causes that change over time: pumps, drifts and water tables that grow or swing.

The recording is divided into windows. A run with the cause in one window alone gives the change
that this window makes. To first order the windows add up. So any course g(t) of the cause changes
the maps by the sum of g times the changes of the windows:

    growing       g = t / T
    swinging      g = a sin(2 pi t / P) + b cos(2 pi t / P)

with the time t since the start, the duration T, and one of several periods P. Words give times of
the recording. The search has tried effects with an onset already.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import GRAVITY
from porotwin_core.clock.time_units import time_unit
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import Schedule, ScheduleRow, WellRate
from porotwin_diagnosis.advice.cause import MOST_CHANGE, Amounts, Cause, Place
from porotwin_diagnosis.advice.free_runs import Adapt, FreeRuns, Window
from porotwin_diagnosis.model.library import pumping_wells, search_context
from porotwin_solver.coefficients.physics import Physics
from porotwin_solver.effects.background_flow import EFFECT as BACKGROUND_FLOW
from porotwin_solver.effects.definition.effect import Process

WINDOWS = 12
"""Parts of a recording: four for the shortest period."""

PERIODS = (0.35, 0.45, 0.6, 0.8, 1.1, 1.6)
"""Periods of a swing relative to the duration. They are 30 % apart, so that the phase is at most a
sixth of a period off at the end."""

RATE_CHANGE = 0.1
"""Relative change of a rate in the runs [-]: it changes the maps more than round-off does."""

TABLE_CHANGE = 1.0
"""Tilt of the water table in the runs [Pa]: 0.1 mm of water."""


@dataclass(frozen=True, eq=False)
class _Force:
    """Something that may change over time, with the changes that its windows make.

    Attributes:
        name: short name.
        process: the process that it changes.
        unit: unit of its strength.
        windows: change of the maps by each window per unit of strength, (nt, nz, nx) each.
        said: returns the strength in words.
        place: its place, or None.
        most: largest possible strength.
        check: how to check it in the laboratory; empty for the check of its process.
    """

    name: str
    process: Process
    unit: str
    windows: Sequence[FloatArray]
    said: Callable[[float], str]
    place: Place | None = None
    most: float = math.inf
    check: str = ''


def causes_over_time(runs: FreeRuns) -> Iterator[Cause]:
    """Yield growing and swinging causes; those that the model cannot run are left out."""
    windows = list(pairwise(_edges(runs)))
    for make in (_rates, _drifts, _water_table):
        for force in make(runs, windows):
            yield from _courses(runs, force)


def _edges(runs: FreeRuns) -> list[float]:
    """Return the times [s] of the recording between which the windows lie."""
    edges = runs.sample.model_start + np.linspace(0.0, runs.duration, WINDOWS + 1)
    return [float(edge) for edge in edges]


def _courses(runs: FreeRuns, force: _Force) -> Iterator[Cause]:
    windows = np.stack(force.windows)
    times = (np.arange(WINDOWS) + 0.5) / WINDOWS
    unit = time_unit(runs.duration)
    whole = unit.text(runs.duration)

    def grown(amounts: Amounts) -> str:
        return f'{force.said(amounts[0])} at the end, growing from nothing in {whole}'

    yield _cause(force, 'growing', [np.tensordot(times, windows, axes=1)], grown, 1)
    for period in PERIODS:
        phase = 2.0 * np.pi * times / period

        def swung(amounts: Amounts, period: float = period) -> str:
            size = math.hypot(*amounts)
            first = math.atan2(amounts[0], amounts[1]) / (2.0 * math.pi) % 1.0 * period
            peak = runs.sample.model_start + first * runs.duration
            return (
                f'{force.said(size)} at {unit.text(peak)}, and the opposite half '
                f'a period later, with a period of {unit.text(period * runs.duration)}'
            )

        waves = [np.tensordot(wave, windows, axes=1) for wave in (np.sin(phase), np.cos(phase))]
        yield _cause(force, 'swinging', waves, swung, 3)


def _cause(
    force: _Force,
    course: str,
    changes: Sequence[FloatArray],
    words: Callable[[Amounts], str],
    freedom: int,
) -> Cause:
    """Return the cause that `force` is with this `course`."""
    return Cause(
        f'{force.name}, {course}',
        force.process,
        force.unit,
        np.stack(changes),
        words,
        force.place,
        freedom,
        lambda amounts: math.hypot(*amounts) <= force.most,
        force.check,
    )


def _rates(runs: FreeRuns, windows: Sequence[Window]) -> Iterator[_Force]:
    """Yield the relative change of the rate of every pumping well."""
    schedule = runs.sample.schedule
    for name in pumping_wells([runs.sample]):
        try:
            changes = [
                (runs.with_schedule(_with_rate(schedule, name, window)) - runs.maps) / RATE_CHANGE
                for window in windows
            ]
        except InputError:  # the rig is closed: one rate alone cannot change
            continue
        well = runs.sample.rig.wells[name]

        def said(strength: float, name: str = name) -> str:
            more = 'more' if strength > 0 else 'less'
            return f'well {name} pumps {100 * abs(strength):.1f} % {more} than commanded'

        place = (well.x_m, well.z_m)
        check = f'weigh the bottle of {name} each minute during an injection'
        yield _Force(f'rate {name}', Process.SOURCE, '-', changes, said, place, MOST_CHANGE, check)


def _with_rate(schedule: Schedule, well: str, window: Window) -> Schedule:
    """Return `schedule` with a changed rate of `well` within `window` [s]."""
    begin, end = window

    def changed(row: ScheduleRow) -> ScheduleRow:
        rate = replace(row.rate, rate=row.rate.rate * (1.0 + RATE_CHANGE))
        return replace(row, rate=rate)

    own = [row for row in schedule.rows if row.well == well]
    rows = [
        changed(row) if row in own and begin <= row.time < end else row for row in schedule.rows
    ]
    known = {row.time for row in own}
    if begin not in known:
        rows.append(changed(ScheduleRow(begin, well, _rate_at(schedule, well, begin))))
    if end not in known:
        rows.append(ScheduleRow(end, well, _rate_at(schedule, well, end)))
    return replace(schedule, rows=tuple(rows))


def _rate_at(schedule: Schedule, well: str, time: float) -> WellRate:
    return schedule.at(time).get(well, WellRate())


def _drifts(runs: FreeRuns, windows: Sequence[Window]) -> Iterator[_Force]:
    """Yield a flow through the whole rig, across and up."""
    context = search_context([runs.sample], runs.sample)
    flux = context.front_speed * context.porosity
    for name, axis in (('drift across', (1.0, 0.0)), ('drift up', (0.0, 1.0))):

        def moved(physics: Physics, axis: tuple[float, float] = axis) -> Physics:
            x, z = physics.background_flux
            return replace(physics, background_flux=(x + flux * axis[0], z + flux * axis[1]))

        def said(strength: float, axis: tuple[float, float] = axis) -> str:
            sides = ('to the right', 'to the left') if axis[0] else ('up', 'down')
            side = sides[0] if strength > 0 else sides[1]
            size = f'{3.6e6 * abs(strength):.2g} mm/h'
            return f'water flows through the whole rig {side}, {size} of Darcy flux'

        check = BACKGROUND_FLOW.laboratory_check
        yield from _of_windows(runs, windows, moved, flux, (name, 'm/s', said, check))


def _water_table(runs: FreeRuns, windows: Sequence[Window]) -> Iterator[_Force]:
    """Yield the tilt of the water table on an open upper side."""
    rig = runs.sample.rig
    if rig.boundaries.top != 'open':
        return

    def tilted(physics: Physics) -> Physics:
        return replace(physics, table_tilt=physics.table_tilt + TABLE_CHANGE)

    def said(strength: float) -> str:
        side = 'right' if strength > 0 else 'left'
        height = abs(strength) / (rig.density_kg_m3 * GRAVITY)
        return f'the water table stands {1e3 * height:.2g} mm higher at the {side}'

    check = 'read the height of the water at both sides during an injection'
    described = ('water table', 'Pa', said, check)
    yield from _of_windows(runs, windows, tilted, TABLE_CHANGE, described)


def _of_windows(
    runs: FreeRuns,
    windows: Sequence[Window],
    adapt: Adapt,
    strength: float,
    described: tuple[str, str, Callable[[float], str], str],
) -> Iterator[_Force]:
    """Yield the force that `adapt` makes with this `strength`; nothing if the model cannot run.

    `described` is its name, the unit of its strength, the strength in words, and its check.
    """
    try:
        changed = runs.changed_within(windows, adapt)
    except InputError:
        return
    name, unit, said, check = described
    changes = [(maps - runs.maps) / strength for maps in changed]
    yield _Force(name, Process.TRANSPORT, unit, changes, said, check=check)
