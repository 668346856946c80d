"""Causes in the camera and its light that the library does not have.

| cause | change of the map c |
| --- | --- |
| a paler plume; light that swings | -c; c sin(2 pi t / P), c cos(2 pi t / P) |
| a plume that is paler upward | c (z - H / 2) |
| a picture that creeps | -grad c t / T |
| a clock that runs wrong | -dc/dt t / T |
| a signal that lags behind | s - c, with ds/dt = (c - s) / delay |
| a glow that is no tracer, at rest or moving | exp(-r^2 / (2 radius^2)) |

t is the time since the start, T the duration, H the height of the rig.
"""

import math
from collections.abc import Iterator

import numpy as np
from scipy.ndimage import gaussian_filter

from porotwin_core.clock.time_units import time_unit
from porotwin_core.geometry.grid import FloatArray
from porotwin_diagnosis.advice.cause import MOST_CHANGE, Amounts, Cause
from porotwin_diagnosis.advice.free_runs import FreeRuns
from porotwin_diagnosis.data.noise import blurred
from porotwin_diagnosis.data.shared_errors import derivatives
from porotwin_solver.effects.definition.effect import Process
from porotwin_solver.effects.saturation import EFFECT as SATURATION

SLOPE_WIDTH = 1.0
"""Width [cells] over which maps are smoothed before they are differentiated."""

DILUTIONS = SATURATION.laboratory_check
GREY_CARD = 'photograph a grey card beside the rig all the time'
REFLECTION = 'look at this place from another side: a reflection in the glass moves with the eye'
FIXED_MARK = (
    'look for a fixed mark, such as a corner of the rig, in the first and the last photograph'
)
"""How to check the response, the light, the glass and the place of the camera."""

STILL_SEEN = 0.5
"""Change of the light, or way of the picture over the width of the rig, after which the tracer is
still seen."""

SWINGS = (0.6, 1.1)
"""Periods of light relative to the duration of the recording."""

DELAYS = (0.02, 0.04, 0.08, 0.16, 0.3)
"""Delays of a signal relative to the duration of the recording."""

STEPS = 120
"""Maps that a lagging signal is computed from: several per shortest delay."""

GLOW_RADII = (0.025, 0.04, 0.06)
"""Radii of a glow relative to the width of the rig."""

LEAST_WAY = 0.01
"""Way of a spot relative to the width of the rig below which it stands."""

LEAST_PART = 0.05
"""Share of a way below which its part across, or up, is not told."""

TRACKING_ROUNDS = 10
"""Reweighted fits of the path of a moving glow."""


def causes_of_the_camera(runs: FreeRuns) -> Iterator[Cause]:
    """Yield the causes of the table above."""
    yield from _light(runs)
    yield from _picture(runs)
    yield from _signals_behind(runs)
    for radius in GLOW_RADII:
        yield from _glows(runs, radius * runs.sample.grid.width)


def _light(runs: FreeRuns) -> Iterator[Cause]:
    c, grid = runs.maps, runs.sample.grid
    unit = time_unit(runs.duration)

    def paler(amounts: Amounts) -> str:
        return f'the plume is {100 * abs(amounts[0]):.1f} % {_paler(amounts[0])} throughout'

    def upward(amounts: Amounts) -> str:
        change = 0.5 * abs(amounts[0]) * grid.height
        places = ('top', 'bottom') if amounts[0] < 0 else ('bottom', 'top')
        share = 100 * (1.0 - (1.0 - change) / (1.0 + change))
        return f'the plume is {share:.1f} % paler at the {places[0]} than at the {places[1]}'

    def upward_allows(amounts: Amounts) -> bool:
        return _moderate([0.5 * grid.height * amounts[0]])

    yield Cause(
        'paler', Process.CAMERA, '-', -c[None], paler, allows=_moderate, own_check=DILUTIONS
    )
    height = grid.z[:, None] - 0.5 * grid.height
    changes = (c * height)[None]
    yield Cause(
        'paler upward',
        Process.CAMERA,
        '1/m',
        changes,
        upward,
        allows=upward_allows,
        own_check=GREY_CARD,
    )
    for period in SWINGS:
        phase = 2.0 * np.pi * runs.elapsed / period

        def swung(amounts: Amounts, period: float = period) -> str:
            return (
                f'the light swings by {100 * math.hypot(*amounts):.1f} %, with a period of '
                f'{unit.text(period * runs.duration)}'
            )

        waves = np.stack([c * np.sin(phase), c * np.cos(phase)])
        yield Cause(
            'swinging light', Process.CAMERA, '-', waves, swung, None, 3, _moderate, GREY_CARD
        )


def _moderate(amounts: Amounts) -> bool:
    """Return whether light changes so little that the tracer is still seen."""
    return math.hypot(*amounts) <= STILL_SEEN


def _paler(amount: float) -> str:
    return 'paler' if amount > 0 else 'darker'


def _picture(runs: FreeRuns) -> Iterator[Cause]:
    smooth = blurred(np.clip(runs.maps, 0.0, 1.0), SLOPE_WIDTH)
    up, right, _ = derivatives(smooth, runs.sample.grid)
    unit = time_unit(runs.duration)

    def crept(amounts: Amounts) -> str:
        sides = ((amounts[0], 'right', 'left'), (amounts[1], 'up', 'down'))
        parts = ' and '.join(
            f'{1e3 * abs(value):.1f} mm {plus if value > 0 else minus}'
            for value, plus, minus in sides
        )
        return f'the picture creeps by {parts} in {unit.text(runs.duration)}'

    creeping = np.stack([-right * runs.elapsed, -up * runs.elapsed])
    most = STILL_SEEN * runs.sample.grid.width
    yield Cause(
        'creeping picture',
        Process.CAMERA,
        'm',
        creeping,
        crept,
        allows=lambda amounts: math.hypot(*amounts) <= most,
        own_check=FIXED_MARK,
    )


def _signals_behind(runs: FreeRuns) -> Iterator[Cause]:
    """Yield a clock that runs wrong, and signals that lag behind the tracer."""
    sample = runs.sample
    dense = np.linspace(sample.model_start, max(sample.end, sample.times[-1]), STEPS)
    times = np.unique(np.concatenate([dense, sample.times]))
    shown = np.searchsorted(times, sample.times)
    maps = runs.at(times)
    later = np.gradient(maps, times, axis=0)[shown]

    def wrong(amounts: Amounts) -> str:
        late = 'late' if amounts[0] > 0 else 'early'
        return f'the clock of the camera is {abs(amounts[0]):.0f} s {late} at the end'

    yield Cause(
        'wrong speed of the clock',
        Process.CAMERA,
        's',
        (-later * runs.elapsed)[None],
        wrong,
        allows=lambda amounts: abs(amounts[0]) <= runs.duration,
        own_check='photograph the clock of the pumps at the start and at the end',
    )
    for share in DELAYS:
        delay = share * runs.duration

        def lagged(amounts: Amounts, delay: float = delay) -> str:
            return f'the signal follows the tracer with a delay of {amounts[0] * delay:.0f} s'

        change = _lagging(maps, times, delay)[shown] - runs.maps
        yield Cause(
            'lagging signal',
            Process.CAMERA,
            '-',
            change[None],
            lagged,
            freedom=2,
            allows=_between_signal_and_tracer,
        )


def _between_signal_and_tracer(amounts: Amounts) -> bool:
    """Return whether the signal lies between the lagging one and the tracer: never negative."""
    return 0.0 < amounts[0] <= 1.0


def _lagging(maps: FloatArray, times: FloatArray, delay: float) -> FloatArray:
    """Return the signal s of `maps` at `times` [s] with ds/dt = (c - s) / `delay`, same shape."""
    signal = maps.copy()
    for index in range(1, len(times)):
        share = -math.expm1(-(times[index] - times[index - 1]) / delay)
        mean = 0.5 * (maps[index] + maps[index - 1])
        signal[index] = signal[index - 1] + share * (mean - signal[index - 1])
    return signal


def _glows(runs: FreeRuns, radius: float) -> Iterator[Cause]:
    """Yield a glow of `radius` [m] at rest, and one that moves on a line.

    Its place is the one where the smoothed remainder is largest in each fitted frame.
    """
    sample, grid = runs.sample, runs.sample.grid
    expected = sample.noise.expected(runs.maps)
    left = (sample.observed_or_zero - expected) * sample.seen_mask
    width = radius / grid.dx
    smooth = np.abs(gaussian_filter(left, (0.0, width, width)))[: sample.fitted_frames]
    rows, columns = np.unravel_index(
        smooth.reshape(len(smooth), -1).argmax(axis=1), smooth.shape[1:]
    )
    x, z, weights = grid.x[columns], grid.z[rows], smooth.max(axis=(1, 2)) + 1e-12
    times = sample.times[: sample.fitted_frames]
    middle = 0.5 * (sample.model_start + sample.end)

    def cause(name: str, x_at: FloatArray, z_at: FloatArray, place: tuple[float, float]) -> Cause:
        square = (grid.x - x_at[:, None, None]) ** 2
        square = square + (grid.z[:, None] - z_at[:, None, None]) ** 2
        change = np.exp(-0.5 * square / radius**2)

        def words(amounts: Amounts) -> str:
            return (
                f'a spot of some {amounts[0]:+.1f} of stock that is no tracer, about '
                f'{2e3 * radius:.0f} mm across, {_way(runs, x_at, z_at, place)}'
            )

        freedom = 6 if name == 'moving glow' else 4
        return Cause(
            name,
            Process.CAMERA,
            '-',
            change[None],
            words,
            place,
            freedom,
            lambda amounts: abs(amounts[0]) <= MOST_CHANGE,
            REFLECTION,
        )

    at_rest = (float(np.average(x, weights=weights)), float(np.average(z, weights=weights)))
    still = np.zeros(len(sample.times))
    yield cause('glow', still + at_rest[0], still + at_rest[1], at_rest)
    if len(times) < 3:
        return
    along_x, along_z = _line(times, x, z, weights, radius)
    place = (float(np.polyval(along_x, middle)), float(np.polyval(along_z, middle)))
    yield cause(
        'moving glow',
        np.polyval(along_x, sample.times),
        np.polyval(along_z, sample.times),
        place,
    )


def _way(runs: FreeRuns, x_at: FloatArray, z_at: FloatArray, place: tuple[float, float]) -> str:
    """Return where a spot stands, or how it moves, in words."""
    seconds = float(np.ptp(runs.sample.times))
    unit = time_unit(seconds)
    per_unit = 1e3 * unit.seconds / max(seconds, 1e-9)
    across, up = float(x_at[-1] - x_at[0]), float(z_at[-1] - z_at[0])
    whole = math.hypot(across, up)
    if whole < LEAST_WAY * runs.sample.grid.width:
        return f'stands at x = {place[0]:.2f} m, z = {place[1]:.2f} m'
    sides = ((across, 'right', 'left'), (up, 'up', 'down'))
    parts = ' and '.join(
        f'{per_unit * abs(way):.2g} mm/{unit.name} {plus if way > 0 else minus}'
        for way, plus, minus in sides
        if abs(way) > LEAST_PART * whole
    )
    return f'moves {parts}; half-way it is at x = {place[0]:.2f} m, z = {place[1]:.2f} m'


def _line(
    times: FloatArray, x: FloatArray, z: FloatArray, weights: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Return the lines x(t) and z(t), as polynomials, that most of the places lie on."""
    share = weights.copy()
    along_x = along_z = np.zeros(2)
    for _ in range(TRACKING_ROUNDS):
        along_x, along_z = (np.polyfit(times, values, 1, w=share) for values in (x, z))
        apart = np.hypot(x - np.polyval(along_x, times), z - np.polyval(along_z, times))
        share = weights / (1.0 + (apart / radius) ** 2)
    return along_x, along_z
