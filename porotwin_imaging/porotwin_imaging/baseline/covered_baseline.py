"""Whether something covered the sand of the baseline: later photographs agree, and it differs.

A hand before the baseline looks like a hole in every later photograph. Several of them tell the two
cases apart: they show one and the same pattern of grains there, which the baseline lacks. An object
that stands before the sand in all later photographs hides the grains of those, and not of the
baseline.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.remark import NAMED, Remark
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.baseline.photo_cells import PhotoCells, photo_cells
from porotwin_imaging.baseline.validity import hidden_sand
from porotwin_imaging.geometry.frame import LARGE_SHARE, VALIDITY
from porotwin_imaging.numerics.cell_sums import BlockSums
from porotwin_imaging.numerics.stopwatch import Stopwatch
from porotwin_imaging.photograph.linear_light import linear_light

Array = NDArray[Any]
Mask = NDArray[np.bool_]

COMPARED = 5
"""Photographs that stand for an experiment, evenly spread, from small to large plumes: a hand is
not in the same place in all of them. More cost time."""
_FEWEST = 2
"""Fewest photographs that can agree with each other."""
_CLEARER = 2.0
"""Ratio of the contrasts of grains with and without a cover."""
_MOSTLY = 0.7
"""Least share of a hole with equal grains in the photographs [-]: 1 with a hand in the baseline."""
_MARGIN = np.ones((3, 3), np.uint8)
"""One block around a hole is left out as well: corners and blurred rims look like sand."""
COVERED = (
    'the baseline{files} does not show the sand on {share:.1%} of the rig, where {photographs} '
    'later photographs agree with each other; a hand or an object was before it, or the sand has '
    'changed since: take another baseline. Until then these cells are left out of all maps'
)


def uncovered(
    baseline: Baseline, photographs: Sequence[Callable[[], bytes]], names: Sequence[str] = ()
) -> tuple[Baseline, Remark | None]:
    """Return the baseline without its covered sand, and the remark about it; None if all is seen.

    Args:
        baseline: the baseline.
        photographs: functions that read the state photographs; a few of them are called.
        names: names of the files of the baselines.

    Raises:
        InputError: too much of the sand is covered; the message names the baseline.
    """
    hole, count = _hole(baseline, photographs)
    if hole is None:
        return baseline, None
    rows, columns = baseline.usable.shape
    shown = cv2.resize(
        (~hole[::-1]).astype(np.uint8), (columns, rows), interpolation=cv2.INTER_NEAREST
    )
    usable = (baseline.usable * shown).astype(np.uint8)
    share = baseline.sampling.cell_means(usable.astype(np.float32))
    sand = baseline.share > VALIDITY.least_visible_share
    lost = float((sand & (share <= VALIDITY.least_visible_share)).sum() / max(1, sand.sum()))
    files = ', '.join(name for name in names[:NAMED] if name)
    cover = Remark.of(
        'baseline',
        'covered_baseline',
        COVERED,
        files=files and f' {files}',
        share=lost,
        photographs=count,
    )
    if lost > VALIDITY.most_hidden:
        raise InputError(str(cover))
    return replace(baseline, usable=usable, share=share), cover


def _hole(
    baseline: Baseline, photographs: Sequence[Callable[[], bytes]]
) -> tuple[Mask | None, int]:
    """Return the blocks (rows, columns) that only the baseline hides, None without, and a count.

    The count is the number of compared photographs.
    """
    places = np.linspace(0, len(photographs) - 1, min(len(photographs), COMPARED))
    reference: Baseline | None = None
    differs = agree = clearer = blurred = np.ones(1, bool)
    count = 0
    for place in np.round(places).astype(int):
        cells = _cells(photographs[place], baseline)
        if cells is None:
            continue
        count += 1
        seen, before = _contrasts(cells.sums.blocks)
        sand = cells.sums.blocks.share > VALIDITY.least_visible_share
        smooth = (before < VALIDITY.least_texture) & (seen > _CLEARER * before)
        differs = differs & sand & (hidden_sand(cells.sums.blocks) | smooth)
        clearer = clearer & (seen > _CLEARER * before)
        blurred = blurred & (before > _CLEARER * seen)
        if reference is None:
            agree = seen > VALIDITY.least_texture  # grains that others can agree with
            reference = replace(baseline, colours=_colours(cells, baseline))
        else:
            agree = agree & _agreeing(photographs[place], reference)
        if (differs & agree).sum() < LARGE_SHARE * sand.sum():
            return None, count
    if count < _FEWEST:
        return None, count
    hole = _of_the_baseline(differs, agree, clearer, blurred)
    return (hole if hole.sum() >= LARGE_SHARE * sand.sum() else None), count


def _cells(read: Callable[[], bytes], baseline: Baseline) -> PhotoCells | None:
    """Return the cells of a photograph; None for a bad one, which the maps tell."""
    try:
        return photo_cells(read(), baseline, Stopwatch())
    except (InputError, OSError):
        return None


def _colours(cells: PhotoCells, baseline: Baseline) -> Array:
    """Return the linear colours of a photograph on the sampling grid, (rows, columns, 3)."""
    return linear_light(baseline.sampling.sample(cells.pixels, cells.alignment.homography))


def _agreeing(read: Callable[[], bytes], reference: Baseline) -> Mask:
    """Return the blocks with the grains of the `reference` in a photograph."""
    cells = _cells(read, reference)
    return ~hidden_sand(cells.sums.blocks) if cells else np.zeros(1, bool)


def _contrasts(sums: BlockSums) -> tuple[Array, Array]:
    """Return the contrast of grains in the blocks of a photograph and of the baseline [-]."""
    share = np.maximum(sums.share, 1e-3)[..., None]
    found = []
    for square, mean in ((sums.state_square, sums.state), (sums.baseline_square, sums.baseline)):
        light = ((mean / share) ** 2).sum(axis=2)
        scatter = (square / share).sum(axis=2) - light
        found.append(np.sqrt(np.maximum(scatter, 0.0) / np.maximum(light, 1e-12)))
    return found[0], found[1]


def _of_the_baseline(differs: Mask, agree: Mask, clearer: Mask, blurred: Mask) -> Mask:
    """Return the places (rows, columns) where the baseline is at fault.

    A cover has fewer grains than the sand. Its rim has more, in whichever picture it is.

    Args:
        differs: blocks with other grains than the baseline, in all photographs.
        agree: blocks with equal grains in all photographs.
        clearer: blocks with clearer grains in all photographs than in the baseline.
        blurred: blocks with clearer grains in the baseline.
    """
    count, parts = cv2.connectedComponents(differs.astype(np.uint8))
    size, same, more, less = (
        np.bincount(parts.ravel(), which.ravel(), minlength=count)
        for which in (differs, agree, clearer, blurred)
    )
    at_fault = (same >= _MOSTLY * size) & (more >= less)
    hole = (differs & at_fault[parts]).astype(np.uint8)
    return np.asarray(cv2.dilate(hole, _MARGIN) > 0)
