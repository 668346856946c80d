"""The sections of `rig.yaml`: boundaries, wells, camera and effects. Units are in the key names."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat

DEFAULT_WELL_RADIUS = 0.004
"""Radius of a well without `radius_m` [m]: a tube of the small rig (experiment folder format)."""

Side = Literal['open', 'closed']
"""Condition on one side of the rig."""

Pixel = tuple[FiniteFloat, FiniteFloat]
"""A place in a photograph: (column, row) [px]."""

Point = tuple[FiniteFloat, FiniteFloat]
"""A place in the rig: (x, z) [m] from its lower left corner."""

LEAST_CORNERS = 3
"""Fewest corners of a polygon."""


def check_corners(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """Return `points` (x, z) [m] if they can be a polygon.

    Raises:
        ValueError: fewer than three points.
    """
    if len(points) < LEAST_CORNERS:
        raise ValueError('needs at least three (x, z) points')
    return points


Polygon = Annotated[tuple[Point, ...], AfterValidator(check_corners)]
"""The corners (x, z) [m] of a zone, in either direction."""

Positive = Annotated[FiniteFloat, Field(gt=0)]
"""A finite number above zero."""


class Section(BaseModel):
    """A part of the description: immutable, and unknown keys are refused."""

    model_config = ConfigDict(extra='forbid', frozen=True)


class MapReference(Section):
    """A property that varies over the rig: a NetCDF `variable` (z, x) in `file`.

    The path of `file` is relative to the folder of `rig.yaml`.
    """

    file: str
    variable: str


class Boundaries(Section):
    """Conditions on the four sides.

    `open` keeps the fluid potential constant (a water table). `closed` lets nothing through.
    """

    top: Side = 'open'
    bottom: Side = 'closed'
    left: Side = 'closed'
    right: Side = 'closed'


class Well(Section):
    """A well: a disc of radius `radius_m` around (`x_m`, `z_m`)."""

    x_m: FiniteFloat
    z_m: FiniteFloat
    radius_m: Positive = DEFAULT_WELL_RADIUS


class Camera(Section):
    """The place of the rig in the photographs; pixels are (column, row).

    `corners_px`: the upper left, lower left, lower right and upper right corner of the rig.
    `colour_checker_px`: the dark skin, white, black and bluish green corner of the colour chart.
    `curvature`: terms of the lens and of the bulging front plate, by name; see
    `porotwin_imaging.geometry`.
    """

    corners_px: tuple[Pixel, Pixel, Pixel, Pixel]
    colour_checker_px: tuple[Pixel, Pixel, Pixel, Pixel] | None = None
    curvature: dict[str, FiniteFloat] = Field(default_factory=dict)


class EffectDescription(Section):
    """A physical effect by name, with its parameters; a diagnosis adds them to a rig."""

    name: str
    parameters: dict[str, FiniteFloat | str] = Field(default_factory=dict)
