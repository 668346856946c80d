"""Observed maps of one experiment, and the pairs of them that can be used."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.geometry.map_blocks import LEAST_SEEN
from porotwin_core.rates.wells import Schedule, WellRate, WellRates
from porotwin_core.rates.wells import mean_rates as mean_of_periods

TIME_STEP_TOLERANCE = 0.02
"""Largest relative difference of two equal time steps [-]; a camera's clock jitters."""


TOO_LITTLE_SEEN = 'pairs with too little seen'
"""Reason for a pair that is left out: one of its maps shows less than `LEAST_SEEN`."""

ACROSS_INTERRUPTION = 'pairs across an interruption'
"""Reason for a pair that is left out: the second map does not follow from the first."""


def wrong_interval(time_step: float) -> str:
    """Return the reason for a pair that is left out because of its time step [s]."""
    return f'pairs not {time_step:g} s apart'


@dataclass(frozen=True)
class Frames:
    """Observed concentration of one experiment over time.

    `times` [s] ascend; `concentration` is (time, nz, nx) with NaN where nothing is known, and
    `deviation` its standard deviation where the maps tell one. The sequence was interrupted at each
    of `clean_times` [s]: no pair may contain one.
    """

    times: FloatArray
    concentration: FloatArray
    schedule: Schedule
    deviation: FloatArray | None = None
    clean_times: tuple[float, ...] = ()
    name: str = 'experiment'


def resampled(frames: Frames, grid: Grid) -> Frames:
    """Return the frames on another grid; deviations are averaged as well."""

    def moved(maps: FloatArray) -> FloatArray:
        return np.array([conservative_resample(values, grid.shape) for values in maps])

    if frames.concentration.shape[1:] == grid.shape:
        return frames
    deviation = None if frames.deviation is None else moved(frames.deviation)
    return replace(frames, concentration=moved(frames.concentration), deviation=deviation)


def cut(frames: Frames, end: float) -> Frames:
    """Return the frames up to `end` [s]."""
    return _chosen(frames, frames.times <= end)


def sequences(frames: Frames) -> list[Frames]:
    """Return the parts between interruptions, in which every frame follows from the first one."""
    edges = np.searchsorted(frames.clean_times, frames.times, side='right')
    return [_chosen(frames, edges == number) for number in np.unique(edges)]


def _chosen(frames: Frames, chosen: NDArray[np.bool_]) -> Frames:
    return replace(
        frames,
        times=frames.times[chosen],
        concentration=frames.concentration[chosen],
        deviation=None if frames.deviation is None else frames.deviation[chosen],
    )


class FramePair(NamedTuple):
    """Frames `number` and `number` + 1 of one experiment.

    `follows` says whether the pair before this one ended with its first frame. `sequence` counts
    the interruptions before it: states of different sequences have nothing in common.
    """

    number: int
    follows: bool
    sequence: int


def frame_pairs(frames: Frames, time_step: float, dropped: Counter[str]) -> Iterator[FramePair]:
    """Yield every usable pair of consecutive frames `time_step` [s] apart.

    `dropped` counts the other pairs by the reason why they are left out.
    """
    known = [enough_seen(frame) for frame in frames.concentration]
    sequence, expected = 0, -1
    for n, (start, end) in enumerate(zip(frames.times, frames.times[1:], strict=False)):
        if any(start < clean <= end for clean in frames.clean_times):
            dropped[ACROSS_INTERRUPTION] += 1
            sequence += 1
        elif not same_time_step(end - start, time_step):
            dropped[wrong_interval(time_step)] += 1
        elif known[n] and known[n + 1]:
            yield FramePair(n, n == expected, sequence)
            expected = n + 1
        else:
            dropped[TOO_LITTLE_SEEN] += 1


def enough_seen(concentration: FloatArray) -> bool:
    """Return whether a map (nz, nx) shows enough of the sand for training or evaluation."""
    return bool(np.isfinite(concentration).mean() >= LEAST_SEEN)


def same_time_step(first: float, second: float) -> bool:
    """Return whether two time steps [s] agree within `TIME_STEP_TOLERANCE`."""
    return math.isclose(first, second, rel_tol=TIME_STEP_TOLERANCE)


def mean_rates(schedule: Schedule, start: float, end: float) -> dict[str, WellRate]:
    """Return the rates of `core`'s `mean_rates`: COSTA knows one rate per well and interval."""
    return mean_of_periods(schedule.intervals(start, end))


def rate_vector(rates: WellRates, wells: Sequence[str]) -> FloatArray:
    """Return water rate and tracer rate of each well [m^3/s], shape (wells, 2).

    Raises:
        InputError: a well that is not among `wells` pumps.
    """
    for name, well in rates.items():
        if name not in wells and well.rate != 0.0:
            raise InputError(
                f"well '{name}': COSTA knows {', '.join(wells)}; train it for this rig"
            )
    vector = np.zeros((len(wells), 2))
    for row, name in enumerate(wells):
        well = rates.get(name, WellRate())
        vector[row] = well.rate, max(well.rate, 0.0) * well.concentration
    return vector


PerReason = Mapping[str, int]
"""Number of pairs left out, by reason."""


def left_out(dropped: PerReason) -> str:
    """Return the reasons and numbers as text for a person; empty if nothing was left out."""
    return ', '.join(f'{count} {reason}' for reason, count in dropped.items() if count)
