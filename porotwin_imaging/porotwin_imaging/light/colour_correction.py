"""Correcting colours and light: the chart or other places, and the drift of light.

The baseline gives the colour matrix of the camera and the colours of the chart. In a photograph the
same chart gives the gain of the light, and the sand without tracer shows how the gain varies over
the rig (`light_drift.py`).
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Camera
from porotwin_imaging.geometry.alignment import TURNS
from porotwin_imaging.light import colour_checker
from porotwin_imaging.light.colour_checker import COLOUR_CHECKER
from porotwin_imaging.light.light_references import LightReferences, light_references, surroundings
from porotwin_imaging.photograph.linear_light import linear_light, linear_light_near

Array = NDArray[Any]


@dataclass(frozen=True)
class ColourReference:
    """The colours of the baseline.

    Attributes:
        corners: nominal corners of the chart as (column, row) in the decoded photograph, shape
            (4, 2); None if the rig has no chart.
        patches: linear colours of the chart in the baseline, shape (24, 3); None if it was not
            found.
        matrix: from colours of the camera to published colours, shape (3, 3); the identity if
            there is no chart.
        places: places that never change, which tell the light where no chart is seen; None if the
            rig names none.
        surroundings: what lies beside the sand, which can confirm another exposure; None if the
            rig names a chart or places.
    """

    corners: Array | None
    patches: Array | None
    matrix: Array
    places: LightReferences | None = None
    surroundings: LightReferences | None = None

    @property
    def corrected_patches(self) -> Array | None:
        """Colours of the chart after the correction, shape (24, 3); None if it was not found."""
        return None if self.patches is None else self.patches @ self.matrix.T


def checker_corners(camera: Camera, reduction: int) -> Array | None:
    """Return the nominal corners of the chart as (column, row) in the decoded photograph."""
    if camera.colour_checker_px is None:
        return None
    return (np.array(camera.colour_checker_px) + 0.5) / reduction - 0.5


MOVED_RIG = (
    ': the camera or the rig has probably moved since the corners were marked, and all maps are '
    'displaced; mark camera.corners_px and camera.colour_checker_px anew'
)
"""The meaning of a chart far from its place, for a remark."""


def colour_reference(
    pixels: NDArray[np.uint8],
    camera: Camera,
    reduction: int,
) -> tuple[ColourReference, list[str]]:
    """Return the colours of a decoded baseline, and remarks about the chart.

    `pixels` has shape (rows, columns, 3), blue-green-red, decoded at `reduction`.

    Raises:
        InputError: the chart shows that the photograph is turned or mirrored.
    """
    corners = checker_corners(camera, reduction)
    places = light_references(pixels, camera, reduction)
    beside = surroundings(pixels, camera, reduction) if corners is None and not places else None
    without_chart = ColourReference(corners, None, np.eye(3), places, beside)
    if corners is None:
        return without_chart, []
    found = colour_checker.find_checker(linear_light(pixels), corners)
    if found is None:
        _refuse_turned(pixels, corners)
        return without_chart, ['colour checker not found: light is judged by the sand alone']
    matrix, used = colour_checker.fit_matrix(found.patches, colour_checker.REFERENCE)
    if not colour_checker.is_plausible(matrix):
        return without_chart, ['colour checker not plausible: light is judged by the sand alone']
    remark = (
        f'colour checker found {found.moved_px * reduction:.0f} px from its given place, '
        f'{used.sum()} of 24 patches used'
    )
    if found.moved_px > COLOUR_CHECKER.most_moved * pixels.shape[1]:
        remark += MOVED_RIG
    return ColourReference(corners, found.patches, matrix, places), [remark]


def _refuse_turned(pixels: NDArray[np.uint8], corners: Array) -> None:
    """Raise InputError if the chart is where a turned or mirrored photograph shows it."""
    for words, order in TURNS.items():
        back = linear_light(np.ascontiguousarray(pixels[order]))
        if colour_checker.find_checker(back, corners) is not None:
            raise InputError(
                f'photograph is {words}: so it shows the colour chart at '
                'camera.colour_checker_px; turn the photographs back, or correct the camera in '
                'rig.yaml'
            )


def light_at_chart(
    pixels: NDArray[np.uint8],
    homography: Array,
    reference: ColourReference,
) -> tuple[colour_checker.ChartLight | None, list[str]]:
    """Return the light at the chart compared with the baseline, and remarks.

    Without the chart, places that never change tell the light. It is None if neither is visible.
    `homography` (3, 3) is the alignment of the
    decoded photograph `pixels` to the baseline.
    """
    if reference.corners is None or reference.patches is None:
        return _light_at_places(pixels, homography, reference)
    moved = cv2.perspectiveTransform(reference.corners[:, None].astype(np.float64), homography)
    corners = moved[:, 0]
    found = colour_checker.find_checker(linear_light_near(pixels, corners), corners)
    light = None
    if found is not None:
        light = colour_checker.chart_light(found.patches, reference.patches)
    if light is not None:
        return light, []
    if reference.places is not None:
        return _light_at_places(pixels, homography, reference)
    return None, ['colour checker not seen: light is judged by the sand alone']


def light_beside(
    pixels: NDArray[np.uint8], homography: Array, reference: ColourReference
) -> colour_checker.ChartLight | None:
    """Return the light beside the sand; None if that may not count, or is not seen.

    The arguments are those of `light_at_chart`.
    """
    beside = reference.surroundings
    return None if beside is None else beside.light_in(pixels, homography)


def _light_at_places(
    pixels: NDArray[np.uint8], homography: Array, reference: ColourReference
) -> tuple[colour_checker.ChartLight | None, list[str]]:
    """Return the light at the places that never change, and a remark if none of them is seen."""
    if reference.places is None:
        return None, []
    light = reference.places.light_in(pixels, homography)
    if light is None:
        return None, ['camera.references_px are not seen: light is judged by the sand alone']
    return light, []
