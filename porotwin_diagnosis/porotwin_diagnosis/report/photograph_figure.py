"""The last photograph with the place of the gap and the fronts of both models.

The four corners of `camera.corners_px` place a point of the rig. Terms of curvature are left out,
so lines may be some millimetres off.
"""

import io
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Camera, Rig
from porotwin_diagnosis.decision.held_out import HeldOut
from porotwin_diagnosis.decision.verdict import NONE
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.effect_traits import is_of_camera
from porotwin_diagnosis.report.figures import AFTER, BEFORE, FRONT, MOST_HEIGHT

STRONGEST_INK = 0.65
"""Opacity of the gap where it is strongest; the photograph stays visible below it."""

FAINTEST_SHARE = 0.2
"""Strength relative to the strongest below which nothing is drawn: noise tints the whole sand."""

GAP_COLOUR = '#ff2d7a'
"""Colour of the gap: neither sand nor any common dye."""

ToPixels = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""Returns columns and rows [px] of points x, z [m]."""


def photograph(content: bytes, result: Diagnosis) -> Figure:
    """Return the photograph in the file `content`, with the gap and the fronts upon it.

    Without the corners of the rig in its description, nothing is drawn.

    Raises:
        OSError, ValueError, SyntaxError: the file is no picture, or it is broken.
    """
    try:
        # the reader finds the real format itself
        picture = imread(io.BytesIO(content), format='jpg')
    except Image.DecompressionBombError as error:  # a damaged size, mostly
        raise ValueError(str(error)) from None
    height, width = picture.shape[:2]
    scale = min(10.0 / width, MOST_HEIGHT / height)
    figure = Figure(figsize=(scale * width, scale * height))
    axis = figure.add_axes((0, 0, 1, 1))
    axis.imshow(picture, cmap='gray')
    rig = result.recordings[0].rig
    if rig.camera is not None:
        _draw_upon(axis, result, pixels_of(rig, rig.camera))
    axis.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axis.set_axis_off()
    return figure


def pixels_of(rig: Rig, camera: Camera) -> ToPixels:
    """Return the function from metres in `rig` to pixels of `camera`: the homography of corners."""
    metres = [(0.0, rig.height_m), (0.0, 0.0), (rig.width_m, 0.0), (rig.width_m, rig.height_m)]
    rows, values = [], []
    for (x, z), (column, row) in zip(metres, camera.corners_px, strict=True):
        rows.append([x, z, 1.0, 0.0, 0.0, 0.0, -column * x, -column * z])
        rows.append([0.0, 0.0, 0.0, x, z, 1.0, -row * x, -row * z])
        values += [column, row]
    a, b, c, d, e, f, g, h = np.linalg.solve(np.array(rows), np.array(values))

    def to_pixels(x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        scale = g * x + h * z + 1.0
        return (a * x + b * z + c) / scale, (d * x + e * z + f) / scale

    return to_pixels


def _draw_upon(axis: Axes, result: Diagnosis, to_pixels: ToPixels) -> None:
    part = result.held_out[0]
    rig = result.recordings[0].rig
    grid = rig.grid(*part.observed.shape[:0:-1])
    if gap_has_a_place(result):
        strength = result.gap.strength
        share = strength / max(float(strength.max()), 1e-12)
        edges = np.meshgrid(
            np.linspace(0.0, rig.width_m, strength.shape[1] + 1),
            np.linspace(0.0, rig.height_m, strength.shape[0] + 1),
        )
        ink = np.empty((*strength.shape, 4))
        ink[:] = to_rgba(GAP_COLOUR)
        ink[..., 3] = STRONGEST_INK * np.clip((share - FAINTEST_SHARE) / (1 - FAINTEST_SHARE), 0, 1)
        axis.pcolormesh(*to_pixels(*edges), ink, rasterized=True)
    columns, rows = to_pixels(*np.meshgrid(grid.x, grid.z))
    for frame, colour, line in _fronts(result, part):
        if np.nanmin(frame) < FRONT < np.nanmax(frame):
            axis.contour(
                columns, rows, frame, [FRONT], colors=colour, linestyles=line, linewidths=1.8
            )


def gap_has_a_place(result: Diagnosis) -> bool:
    """Return whether the place of the gap means something: no effect of the camera makes it."""
    verdict = result.verdict
    return verdict.name != NONE and not any(map(is_of_camera, verdict.members))


def _fronts(result: Diagnosis, part: HeldOut) -> list[tuple[FloatArray, str, str]]:
    """Return the last predictions with their colours and lines; one without a gap.

    The dashed front comes last, so that both are seen where they coincide.
    """
    before = (part.before[-1], BEFORE, '--')
    return [before] if result.verdict.name == NONE else [(part.after[-1], AFTER, '-'), before]
