"""The cells of one photograph beside the baseline: decoded, aligned, sampled and summed.

Maps of tracer (`photo_to_map.py`) and of phases (`colour_change.py`) start from this.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from porotwin_imaging.baseline.baseline import Baseline
from porotwin_imaging.baseline.baseline_subtraction import cells_per_block
from porotwin_imaging.geometry.alignment import Alignment, align
from porotwin_imaging.geometry.frame import frame_remarks, in_frame
from porotwin_imaging.light.light_check import refuse_grey
from porotwin_imaging.numerics.cell_sums import CellSums, cell_sums
from porotwin_imaging.numerics.stopwatch import Stopwatch
from porotwin_imaging.photograph.linear_light import LINEAR_LIGHT
from porotwin_imaging.photograph.photo_file import DECODING, DecodedPhoto

Array = NDArray[Any]

Veil = tuple[float, float, float]
"""Linear red, green and blue of haze, in colours of the camera."""

Look = Callable[[DecodedPhoto], None]
"""Looks at a photograph that is decoded, and raises InputError if it is refused."""


def accept_all(photo: DecodedPhoto) -> None:
    """Look at nothing."""


@dataclass(frozen=True)
class PhotoCells:
    """A photograph, averaged over the cells of a map.

    Attributes:
        pixels: decoded photograph, uint8, blue-green-red, shape (rows, columns, 3).
        alignment: movement of the camera since the baseline.
        sums: sums of photograph and baseline over each cell.
        share: share of each cell that the baseline shows and that lies in the frame, (nz, nx).
        remarks: sand that has left the frame, one line each.
    """

    pixels: NDArray[np.uint8]
    alignment: Alignment
    sums: CellSums
    share: Array
    remarks: list[str]


def photo_cells(
    data: bytes, baseline: Baseline, watch: Stopwatch, look: Look = accept_all
) -> PhotoCells:
    """Return the cells of the photograph `data` (bytes of the file).

    `watch` collects the duration of each stage. `look` may refuse the decoded photograph.

    Raises:
        InputError: the photograph cannot be used; one line gives the reason.
    """
    sampling = baseline.sampling
    with watch.stage('decode'):
        photo = baseline.decode(data)
        look(photo)
        pixels = photo.pixels
    with watch.stage('align'):
        alignment = align(pixels, baseline.features)
    with watch.stage('remap'):
        sampled = sampling.sample(pixels, alignment.homography)
    with watch.stage('average'):
        framed = in_frame(sampling, alignment.homography, pixels.shape)
        usable, share = _in_view(framed, baseline)
        remarks = frame_remarks(baseline.share, share)
        sums = _cell_sums(sampled, usable, baseline)
        refuse_grey(sums.blocks.state, sums.blocks.baseline)
    return PhotoCells(pixels, alignment, sums, share, remarks)


def log_ratio_below(veil: Veil, cells: PhotoCells, baseline: Baseline) -> Array:
    """Return the log ratio (nz, nx, 3) of a photograph to the baseline without a veil of light.

    The photograph is sampled once more, because only a hazy one needs it.

    Args:
        veil: linear red-green-blue of the veil, in colours of the camera.
        cells: the photograph.
        baseline: the baseline.
    """
    sampled = baseline.sampling.sample(cells.pixels, cells.alignment.homography)
    framed = in_frame(baseline.sampling, cells.alignment.homography, cells.pixels.shape)
    return _cell_sums(sampled, _in_view(framed, baseline)[0], baseline, veil).log_ratio


def _in_view(framed: NDArray[np.bool_] | None, baseline: Baseline) -> tuple[Array, Array]:
    """Return the usable samples, and the share of each cell (nz, nx) that they cover.

    `framed` tells which samples lie in the photograph; None if all of them do.
    """
    if framed is None:
        return baseline.usable, baseline.share
    usable = baseline.usable * framed
    return usable, baseline.sampling.cell_means(usable.astype(np.float32))


def _cell_sums(
    sampled: NDArray[np.uint8], usable: Array, baseline: Baseline, veil: Veil | None = None
) -> CellSums:
    """Return the sums of the sampled photograph and the baseline over each cell."""
    samples = baseline.sampling.samples_across
    return cell_sums(
        sampled,
        baseline.colours,
        usable,
        light=LINEAR_LIGHT,
        matrix=baseline.chart.matrix,
        glare_level=DECODING.bright_level,
        samples_across=samples,
        cells_across=cells_per_block(samples),
        veil=veil,
    )
