"""Finds the colours of dissolved CO2 and gas, from the photographs or from boxes of a person.

A first guess starts an expectation-maximisation: probabilities of all cells
(`phase_segmentation.py`), then the law of each colour and their common scatter from the cells, then
probabilities again. A cell counts by its probability and by the size of its change. So pale fronts
and old stains of the indicator, which cover more cells than a plume, do not draw a colour to water.

Without boxes, the guess for gas are the cells where every channel is brightest, and for dissolved
CO2 those that lie farthest from the way between water and gas.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.numerics.robust_statistics import FEW_ROUNDS, NOISE_SPREADS, TOP_PERCENTILE
from porotwin_imaging.phases.colour_change import Box, ColourChange
from porotwin_imaging.phases.phase_colours import (
    CHANNELS,
    DISSOLVED,
    GAS,
    PHASE,
    PHASES,
    WATER,
    PhaseColours,
)
from porotwin_imaging.phases.phase_segmentation import probabilities

Array = NDArray[Any]
Mask = NDArray[np.bool_]


def found_colours(changes: Sequence[ColourChange], water: Mask) -> PhaseColours:
    """Return the colours of the phases in the photographs.

    Args:
        changes: the photographs.
        water: cells that always show water, shape (nz, nx).

    Raises:
        InputError: nothing has changed its colour.
    """
    smooth = np.stack([_smooth(change) for change in changes])
    gas = _strongest(smooth, smooth.min(axis=-1))
    along = gas / max(float(np.linalg.norm(gas)), SMALLEST_DIVISOR)
    aside = np.linalg.norm(smooth - (smooth @ along)[..., None] * along, axis=-1)
    guess = np.stack([_strongest(smooth, aside), gas])
    colours = _fitted(np.array([WATER, DISSOLVED, GAS]), guess, changes, water)
    if _one_hue(colours):
        strong = _strongest(smooth, np.linalg.norm(smooth, axis=-1))
        colours = _fitted(np.array([WATER, DISSOLVED]), strong[None], changes, water)
    _refuse_nothing(colours, len(changes))
    least = colours.typical.min(axis=1)
    named = [WATER] + [DISSOLVED] * (len(least) - 1)
    brightest = int(least.argmax())
    if len(least) > len((WATER, DISSOLVED)) and brightest > 0:
        named[brightest] = GAS
    return PhaseColours(np.array(named), colours.law, colours.spread)


def given_colours(
    changes: Mapping[float, ColourChange],
    boxes: Mapping[int, Sequence[Box]],
    water: Mask,
    grid: Grid,
) -> PhaseColours:
    """Return the colours of the phases in boxes that a person gives.

    Args:
        changes: photographs by time [s].
        boxes: boxes of each phase; phases without a box are not searched.
        water: cells that always show water, shape (nz, nx).
        grid: the grid of the maps.

    Raises:
        InputError: a box shows no sand, two phases have one colour, or they are exchanged.
    """
    means = {phase: _in_boxes(phase, boxes[phase], changes, grid) for phase in sorted(boxes)}
    phase = np.array([WATER, *means])
    _refuse_exchanged(means, boxes)
    colours = _fitted(phase, np.stack(list(means.values())), list(changes.values()), water)
    if _one_hue(colours):
        raise InputError(
            f'gas {boxes[GAS][0]} and dissolved {boxes[DISSOLVED][0]} have the same colour; '
            'give boxes that show one phase each'
        )
    return colours


def _smooth(change: ColourChange) -> Array:
    """Return the means over 3 x 3 cells (nz, nx, 3), 0 where the sand is not seen."""
    seen = change.visible.astype(np.float32)
    shown = np.where(change.visible[..., None], change.change, 0.0).astype(np.float32)
    weight = np.maximum(cv2.blur(seen, (3, 3)), SMALLEST_DIVISOR)
    return np.asarray(cv2.blur(shown, (3, 3)) / weight[..., None] * seen[..., None])


def _strongest(smooth: Array, measure: Array) -> Array:
    """Return the mean change (3,) of the cells with half of the largest `measure` and more."""
    largest = np.percentile(measure, TOP_PERCENTILE)
    return np.asarray(smooth[measure >= 0.5 * largest].mean(axis=0))


def _fitted(
    phase: NDArray[np.int64], guess: Array, changes: Sequence[ColourChange], water: Mask
) -> PhaseColours:
    """Return the colours after all rounds, from first changes `guess`, shape (n - 1, 3)."""
    law = np.zeros((len(phase), 2, len(CHANNELS)))
    law[1:, 0] = guess
    floor = PHASE.least_spread**2 * np.eye(len(CHANNELS))
    colours = PhaseColours(phase, law, np.diag((guess**2).mean(axis=0)) + floor)
    seen = [change.visible for change in changes]
    change_of = np.concatenate(
        [one.change[cells] for one, cells in zip(changes, seen, strict=True)]
    )
    light = np.concatenate([one.light[cells] for one, cells in zip(changes, seen, strict=True)])
    size = np.linalg.norm(change_of, axis=1)
    for _ in range(FEW_ROUNDS):
        found = [probabilities(change, colours, water) for change in changes]
        law, scatter, total = colours.law.copy(), np.zeros_like(floor), SMALLEST_DIVISOR
        for number in range(1, len(phase)):
            of_colour = [q[number][cells] for q, cells in zip(found, seen, strict=True)]
            weight = np.concatenate(of_colour) * size
            law[number] = _law(change_of, light, weight)
            away = change_of - law[number, 0] - law[number, 1] * light
            scatter += (away * weight[:, None]).T @ away
            total += float(weight.sum())
        colours = PhaseColours(phase, law, scatter / total + floor)
    return colours


def _law(change: Array, light: Array, weight: Array) -> Array:
    """Return a and m of each channel (2, 3) by weighted least squares from cells (n, 3)."""
    total = max(float(weight.sum()), SMALLEST_DIVISOR)
    law = np.empty((2, len(CHANNELS)))
    for channel in range(len(CHANNELS)):
        design = np.stack([np.ones(len(light)), light[:, channel]], axis=1)
        weighted = design * (weight / total)[:, None]
        normal = weighted.T @ design + PHASE.stiffness * np.eye(2)
        law[:, channel] = np.linalg.solve(normal, weighted.T @ change[:, channel])
    return law


def _one_hue(colours: PhaseColours) -> bool:
    """Return whether two colours are one, strong and pale: they lie in one direction from water."""
    if len(colours.phase) <= len((WATER, DISSOLVED)):
        return False
    root = np.linalg.cholesky(np.linalg.inv(colours.spread))
    first, second = colours.typical[1:] @ root
    size = float(np.linalg.norm(first) * np.linalg.norm(second))
    return float(first @ second) >= PHASE.same_hue * size


def _refuse_nothing(colours: PhaseColours, count: int) -> None:
    """Raise InputError if no colour differs from water by more than the scatter of cells."""
    root = np.linalg.cholesky(np.linalg.inv(colours.spread))
    if np.linalg.norm(colours.typical @ root, axis=1).max() < NOISE_SPREADS:
        raise InputError(
            f'{count} photographs: nothing has changed its colour since the baseline by more than '
            'noise; the baseline must show the rig before the injection, with the indicator in '
            'its water'
        )


def _in_boxes(
    phase: int, boxes: Sequence[Box], changes: Mapping[float, ColourChange], grid: Grid
) -> Array:
    """Return the median change (3,) of the cells in the boxes of a phase."""
    times, parts = np.array(list(changes)), []
    for box in boxes:
        time = times[-1] if box.time is None else times[np.abs(times - box.time).argmin()]
        shown = changes[float(time)]
        inside = box.cells(grid) & shown.visible
        if not inside.any():
            raise InputError(f'{PHASES[phase]} {box}: no visible sand in it; give another box')
        parts.append(shown.change[inside])
    return np.asarray(np.median(np.concatenate(parts), axis=0))


def _refuse_exchanged(means: Mapping[int, Array], boxes: Mapping[int, Sequence[Box]]) -> None:
    """Raise InputError if a phase is water, or if gas and dissolved are exchanged."""
    for phase, mean in means.items():
        largest = float(np.abs(mean).max())
        if largest < NOISE_SPREADS * PHASE.least_spread:
            raise InputError(
                f'{PHASES[phase]} {boxes[phase][0]}: its colour differs from the baseline by '
                f'{100 * largest:.0f} %, which is water; give a box that shows '
                f'{PHASES[phase]}, and the time of its photograph after an @'
            )
    if DISSOLVED not in means or GAS not in means:
        return
    dissolved, gas = means[DISSOLVED], means[GAS]
    if gas.mean() < dissolved.mean() and gas.min() < dissolved.min():
        raise InputError(
            f'gas {boxes[GAS][0]} is darker than dissolved {boxes[DISSOLVED][0]}: gas drives the '
            'coloured water away and leaves bright sand; exchange the two'
        )
