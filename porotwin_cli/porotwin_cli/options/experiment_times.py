"""The times of maps: the length of a recording gives them, or the user."""

import math
from typing import TYPE_CHECKING

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.text_with_unit import plain_number
from porotwin_core.clock.photo_interval import USUAL_PHOTO_INTERVAL_S

if TYPE_CHECKING:
    from porotwin_recording.experiment.recording import Recording


MOST_GIVEN_TIMES = 100_000
"""Most maps at given times: four weeks of photographs, one every 25 s."""

MOST_TIMES = 200
"""Most maps where only the rates are known; a longer experiment gets longer steps."""


def recorded_times(recording: 'Recording', *, option: str) -> list[float]:
    """Return the times [s] of the maps, else of the photographs, else of the schedule.

    `option` is the option of the command that tells the times instead, with an example.

    Raises:
        InputError: the recording does not say how long the experiment lasts.
    """
    if recording.maps is not None:
        return [float(time) for time in recording.times]
    photographs = sorted({photo.time for photo in recording.photos if photo.role == 'state'})
    if photographs:
        return photographs
    end = recording.end
    if not end > 0.0:
        raise InputError(
            f'{recording.source}: its rates do not say when the experiment ends; add a row with '
            f'the last time to rates.csv, or give {option}'
        )
    step = USUAL_PHOTO_INTERVAL_S
    while end / step > MOST_TIMES:
        step *= 2.0
    return [*_steps(end, step), end]


def _steps(end: float, step: float) -> list[float]:
    """Return 0, step, ... before `end`."""
    return [index * step for index in range(math.ceil(end / step - 1e-9))]


def times_in(text: str, count: int) -> tuple[float, ...]:
    """Return the `count` numbers that colons divide in `text`; NaN for all if it has no such form.

    A comparison with NaN is false, so that the check of the numbers refuses a wrong form too.
    """
    times = tuple(map(plain_number, text.split(':')))
    return times if len(times) == count else (math.nan,) * count
