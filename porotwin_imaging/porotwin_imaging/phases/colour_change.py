"""The change of colour of every cell since the baseline, whatever has caused it.

Maps of tracer leave out other changes of colour (`light_correction.py`). Here every change of
colour counts, and only the light of the lamps is removed: the colour chart shows it, or sand whose
colour has not changed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import Grid
from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.baseline.baseline_subtraction import log_ratio_variance
from porotwin_imaging.baseline.photo_cells import photo_cells
from porotwin_imaging.baseline.validity import hidden_sand, unclipped_cells
from porotwin_imaging.geometry.alignment import alignment_remarks
from porotwin_imaging.geometry.frame import VALIDITY
from porotwin_imaging.light.colour_correction import light_at_chart
from porotwin_imaging.light.light_check import refuse_unknown_light
from porotwin_imaging.light.light_drift import LIGHT, LightDrift, light_drift
from porotwin_imaging.numerics.cell_sums import LEAST_LIGHT
from porotwin_imaging.numerics.stopwatch import Stopwatch

Array = NDArray[Any]
Mask = NDArray[np.bool_]

_FRONT_STEP = 0.25
"""Change of colour between neighbouring cells that is a front [log]."""

REASONS = ('seen', 'off_sand', 'over_exposed', 'covered')
"""Why a cell has no phase; their numbers in maps are the indices."""
SEEN, OFF_SAND, OVER_EXPOSED, COVERED = range(len(REASONS))


@dataclass(frozen=True)
class Box:
    """A rectangle of the rig whose content a person knows.

    Attributes:
        left, bottom, right, top: its edges [m] from the lower left corner of the sand.
        time: the photograph at this time shows it [s]; None: the last one.
    """

    left: float
    bottom: float
    right: float
    top: float
    time: float | None = None

    def __str__(self) -> str:
        """Return the box as it is written on a command line."""
        edges = ','.join(f'{edge:g}' for edge in (self.left, self.bottom, self.right, self.top))
        return edges if self.time is None else f'{edges}@{self.time:g}'

    def cells(self, grid: Grid) -> Mask:
        """Return the cells (nz, nx) of `grid` whose centres lie in the box.

        Raises:
            InputError: no cell lies in it.
        """
        across = (grid.x >= self.left) & (grid.x <= self.right)
        up = (grid.z >= self.bottom) & (grid.z <= self.top)
        if not (across.any() and up.any()):
            raise InputError(
                f'box {self}: no cell of the rig ({grid.width:g} x {grid.height:g} m) lies in it; '
                'give left, bottom, right, top in metres'
            )
        return up[:, None] & across[None, :]


@dataclass(frozen=True)
class ColourChange:
    """What light a photograph has gained or lost since the baseline, without the lamps.

    Linear light is compared by difference: a ratio would magnify the noise of dark sand.

    Attributes:
        change: light minus the light of the baseline, in each channel relative to the median of
            the sand in the baseline, shape (nz, nx, 3 = red, green, blue).
        variance: its variance from noise, same shape.
        light: light of the baseline relative to its median, same shape.
        reason: why a cell has no phase, index of `REASONS`, shape (nz, nx).
        doubtful: visible cells without the grains of the baseline: gas, or a bright object.
        remarks: one line each.
    """

    change: Array
    variance: Array
    light: Array
    reason: NDArray[np.uint8]
    doubtful: Mask
    remarks: list[str]

    @property
    def visible(self) -> Mask:
        """Cells that show their sand, shape (nz, nx)."""
        return np.asarray(self.reason == SEEN)


def colour_change(data: bytes, baseline: Baseline, water: Sequence[Box] = ()) -> ColourChange:
    """Return the change of colour in the photograph `data` (bytes of the file).

    `water` are boxes whose colour has not changed; they show the light if no chart does.

    Raises:
        InputError: the photograph cannot be used; one line gives the reason.
    """
    baseline = baseline.with_dark_sand()
    cells = photo_cells(data, baseline, Stopwatch())
    variance = log_ratio_variance(
        cells.sums, baseline.chart.matrix, baseline.sampling.samples_across
    )
    unclipped, clipped = unclipped_cells(cells.sums, cells.share)
    shown = cells.sums.share > VALIDITY.least_visible_share
    visible = shown & unclipped
    light, chart = light_at_chart(cells.pixels, cells.alignment.homography, baseline.chart)
    ratio = _without_lamps(
        cells.sums.log_ratio, visible, None if light is None else light.log_gain, water, baseline
    )
    blocks = hidden_sand(cells.sums.blocks)
    lost = _covered(ratio, blocks, VALIDITY.windows_across) & visible
    # without the grains, a darker colour is something before the sand; a brighter one may be gas
    bright = lost & (ratio.max(axis=2) > LIGHT.most_brighter)
    covered = lost & ~bright & (ratio.min(axis=2) < -LIGHT.most_brighter)
    reason = np.select(
        [cells.share <= VALIDITY.least_visible_share, ~unclipped, ~shown, covered],
        [OFF_SAND, OVER_EXPOSED, OFF_SAND, COVERED],
        SEEN,
    ).astype(np.uint8)
    sand = np.maximum(baseline.sand_appearance()[0] @ baseline.chart.matrix.T, 0.0)
    unit = np.maximum(np.median(sand[visible], axis=0), LEAST_LIGHT)
    state = np.exp(ratio) * sand / unit
    remarks = [
        *alignment_remarks(cells.alignment, baseline.reduction),
        *chart,
        *cells.remarks,
        *clipped,
        *_told(reason, bright),
    ]
    noise = (variance + baseline.fluctuation) * state**2
    return ColourChange(state - sand / unit, noise, sand / unit, reason, bright, remarks)


def _told(reason: NDArray[np.uint8], bright: Mask) -> list[str]:
    """Return remarks on cells without a phase, and on bright cells without grains."""
    parts = [
        (reason == OFF_SAND, 'of the rig shows the chart, open water or an object: no phase'),
        (
            reason == COVERED,
            'of the rig is covered: darker, without the grains of the baseline',
        ),
        (bright, 'of the rig is bright without the grains of the baseline: gas, or an object'),
    ]
    return [f'{100 * cells.mean():.1f} % {words}' for cells, words in parts if cells.any()]


def _without_lamps(
    ratio: Array, visible: Mask, gain: Array | None, water: Sequence[Box], baseline: Baseline
) -> Array:
    """Return the log ratio (nz, nx, 3) without the drift of the lamps.

    The colour chart or boxes of water tell the light; without them it is the light of the
    baseline if enough of the sand agrees. Only sand that agrees in all channels is water: CO2 may
    cover most of the rig, and change colours without changing brightness.

    Raises:
        InputError: nothing shows the light, or a box of water does not show any sand.
    """
    known: Array = np.zeros(3) if gain is None else gain
    if water:
        inside = np.logical_or.reduce([box.cells(baseline.grid) for box in water]) & visible
        if not inside.any():
            raise InputError(
                f'water {"; ".join(map(str, water))}: no visible sand in it; give another box'
            )
        if gain is None:
            known = np.median(ratio[inside], axis=0)
    told = gain is not None or bool(water)
    agrees = visible & (np.abs(ratio - known).max(axis=2) < LIGHT.most_brighter)
    share = float(agrees.sum() / max(1, visible.sum()))
    if not told and share < LIGHT.least_background:
        drift = light_drift(ratio, visible.astype(float), None)
        refuse_unknown_light(ratio, visible, drift, chart_seen=False)
    elif share < LIGHT.least_background:  # too little to tell how the light varies over the rig
        constants = np.median(ratio[agrees], axis=0) if agrees.any() else known
        drift = LightDrift(np.asarray(constants, ratio.dtype), np.zeros_like(ratio[..., 0]), share)
    else:
        drift = light_drift(ratio, agrees.astype(float), known, search_range=LIGHT.most_brighter)
    return drift.removed_from(ratio)


def _covered(ratio: Array, hidden: Mask, windows_across: int) -> Mask:
    """Return the cells (nz, nx) of `hidden` blocks that are covered by something.

    At a front of a fluid its step outweighs the grains: hidden places without any cell away from
    fronts are fronts. Gas may hide the grains as well, because it dries them.
    """
    nz, nx = ratio.shape[:2]
    rows = np.arange(nz) * hidden.shape[0] // nz
    columns = np.arange(nx) * hidden.shape[1] // nx
    places = hidden[rows][:, columns]
    smooth = cv2.blur(np.asarray(ratio, np.float32), (3, 3))
    around = np.ones((3, 3), np.uint8)
    step = np.linalg.norm(cv2.dilate(smooth, around) - cv2.erode(smooth, around), axis=2)
    reach = 2 * (nx // windows_across // 2 + 2) + 1
    fronts = cv2.dilate((step > _FRONT_STEP).astype(np.uint8), np.ones((reach, reach), np.uint8))
    parts, count = label(places)
    inside = np.bincount(parts[places & (fronts == 0)], minlength=count + 1) > 0
    inside[0] = False
    return np.asarray(inside[parts])


def box_of(text: str, name: str) -> Box:
    """Return the box that `text` describes: left,bottom,right,top [m], and optionally @time [s].

    Raises:
        InputError: the text is no box; `name` tells where it stands.
    """
    edges, _, time = text.partition('@')
    try:
        left, bottom, right, top = (float(word) for word in edges.split(','))
        when = float(time) if time else None
    except ValueError:
        raise InputError(
            f"{name} '{text}': give left,bottom,right,top in metres, and the time of its "
            'photograph in seconds after an @, such as 0.2,0.1,0.4,0.3@1800'
        ) from None
    numbers = (left, bottom, right, top, 0.0 if when is None else when)
    if not all(map(math.isfinite, numbers)):
        raise InputError(f"{name} '{text}': all its numbers must be finite; write metres")
    if not (left < right and bottom < top):
        raise InputError(f"{name} '{text}': left must be below right, and bottom below top")
    return Box(left, bottom, right, top, when)
