"""The sections of `rig.yaml`: boundaries, wells, camera and effects. Units are in the key names."""

import math
import operator
from collections.abc import Mapping
from itertools import pairwise
from statistics import NormalDist
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    model_validator,
)

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import LONGEST_EXPERIMENT_S, MINUTE_S
from porotwin_core.rig.numbers import (
    Level,
    NotNegative,
    Number,
    Positive,
    PositiveRate,
    Rate,
    Share,
)

DEFAULT_WELL_RADIUS = 0.004
"""Radius of a well without `radius_m` [m]: a tube of the small rig (experiment folder format)."""

Side = Literal['open', 'closed']
"""Condition on one side of the rig."""

SideName = Literal['top', 'bottom', 'left', 'right']
"""The four sides of the rig."""

SIDES: tuple[SideName, ...] = get_args(SideName)

Pixel = tuple[Number, Number]
"""A place in a photograph: (column, row) [px]."""

Point = tuple[Number, Number]
"""A place in the rig: (x, z) [m] from its lower left corner."""

LEAST_CORNERS = 3
"""Fewest corners of a polygon."""

MOST_PLACES = 1000
"""Most corners of a polygon, and most wells: maps take a time and a memory that grow with them."""


def check_corners(points: tuple[Point, ...]) -> tuple[Point, ...]:
    """Return `points` (x, z) [m] after a check that they form a polygon.

    Raises:
        ValueError: too few or too many points.
    """
    if len(points) < LEAST_CORNERS:
        raise ValueError('needs at least three corners')
    if len(points) > MOST_PLACES:
        raise ValueError(f'has {len(points)} points; leave out all but {MOST_PLACES}')
    return points


def refuse_files(value: Any) -> Any:
    """Return `value` after a check that it is no mapping, such as a file reference.

    Raises:
        ValueError: it is one.
    """
    if isinstance(value, dict):
        raise ValueError(  # noqa: TRY004  pydantic turns it into a line about the key
            'needs corners (x, z); a picture is named by control.zone: {file: ...}'
        )
    return value


PixelPolygon = Annotated[
    tuple[Pixel, ...], BeforeValidator(refuse_files), AfterValidator(check_corners)
]
"""The corners (column, row) [px] of a place in a photograph, in either direction."""

Polygon = Annotated[tuple[Point, ...], BeforeValidator(refuse_files), AfterValidator(check_corners)]
"""The corners (x, z) [m] of a zone, in either direction."""


class Section(BaseModel):
    """A part of the description: immutable, and unknown keys are refused."""

    model_config = ConfigDict(extra='forbid', frozen=True)


class MapReference(Section):
    """A property that varies over the rig: a NetCDF `variable` (z, x) in `file`."""

    file: str = Field(description='NetCDF file, relative to the folder of rig.yaml')
    variable: str = Field(description='name of the variable (z, x) in the file, row 0 lowest')


class ZoneFile(Section):
    """A zone as a picture of the whole rig, or as a map of the share of each cell in it."""

    file: str = Field(
        description='picture of the whole rig, the zone white on black; or a NetCDF file (.nc)'
    )
    variable: str = Field(
        'zone', description='of a NetCDF file: share of each cell in the zone, (z, x), row 0 lowest'
    )


class WaterBody(Section):
    """Water at the sand: on a part of a side, or open water in a polygon of the picture.

    It has a level, or it enters at a rate, such as rain. An open side is such a body as well.
    """

    side: SideName | None = Field(None, description='the side of the rig where the water stands')
    from_m: NotNegative = Field(
        0.0, description='begin of the part of the side [m]: x from the left, or z from below'
    )
    to_m: Positive | None = Field(
        None, description='end of the part of the side [m]; default: the end of the side'
    )
    corners_m: Polygon | None = Field(
        None, description='instead of a side: corners (x, z) of open water in the picture [m]'
    )
    head_m: Level | None = Field(
        None, description='height of the level of the water above the lower edge of the sand [m]'
    )
    rate_ml_h: Rate | None = Field(
        None,
        description='instead of a head: rate of the entering water, such as rain; negative: of '
        'leaving water, such as evaporation [ml/h]',
    )
    concentration: Share = Field(
        0.0, description='concentration of the water that enters: 0 water, 1 tracer stock'
    )
    diffuses: bool = Field(
        False, description='whether tracer also diffuses between it and the sand, as at a salt lake'
    )

    @model_validator(mode='after')
    def _is_complete(self) -> Self:
        if (self.side is None) == (self.corners_m is None):
            raise ValueError('needs a place: give either side or corners_m')
        if (self.head_m is None) == (self.rate_ml_h is None):
            raise ValueError('needs either head_m or rate_ml_h')
        if self.corners_m is not None and (
            self.rate_ml_h is not None or self.to_m is not None or self.diffuses
        ):
            raise ValueError(
                'corners_m takes head_m only; rate_ml_h, from_m, to_m and diffuses need a side'
            )
        if self.to_m is not None and self.to_m <= self.from_m:
            raise ValueError(f'from_m {self.from_m:g} must be less than to_m {self.to_m:g}')
        return self

    def with_change(self, rise: float, factor: float) -> Self:
        """Return this water with a level higher by `rise` [m], or a rate times `factor`."""
        head = None if self.head_m is None else self.head_m + rise
        rate = None if self.rate_ml_h is None else self.rate_ml_h * factor
        return self.model_copy(update={'head_m': head, 'rate_ml_h': rate})


class LevelCourse(Section):
    """How the level of an open side or of other water changes after the start.

    It follows straight lines from its head at the start through the points; the last one stays.
    """

    points: tuple[tuple[NotNegative, Level], ...] = Field(
        description='time after the start [min] and level [m] of each point, in their order; two '
        'points of one time are a step',
    )
    every_min: Positive | None = Field(
        None, description='length of a cycle, after which it begins anew [min]; default: never'
    )

    @model_validator(mode='after')
    def _is_in_order(self) -> Self:
        if not self.points:
            raise ValueError('points: give at least one, such as [10, 0.48]')
        minutes = [minute for minute, _ in self.points]
        for before, minute in pairwise(minutes):
            if minute < before:
                raise ValueError(f'points: {minute:g} min follows {before:g} min; sort them')
        if minutes[-1] * MINUTE_S > LONGEST_EXPERIMENT_S:
            raise ValueError(
                f'points: {minutes[-1]:g} min, but no experiment is longer than a year; correct it'
            )
        if self.every_min is not None and self.every_min < 1:
            raise ValueError(
                f'every_min {self.every_min:g}: models know the mean of each minute only; give its '
                'mean level, or a cycle of a minute or more'
            )
        if self.every_min is not None and minutes[-1] > self.every_min:
            raise ValueError(
                f'points: {minutes[-1]:g} min lies beyond the cycle of {self.every_min:g} min; '
                'correct one of them'
            )
        return self


class WaterTable(Section):
    """A water table inside the sand: the sand above the capillary fringe is dry."""

    fringe_m: NotNegative = Field(
        0.0, description='height of the sand that capillarity fills above the water table [m]'
    )


class Boundaries(Section):
    """Conditions on the four sides.

    `open` keeps the fluid potential constant (a water table). `closed` lets nothing through. Water
    flows between open sides with different heads.
    """

    top: Side = Field('open', description='condition on the upper side')
    bottom: Side = Field('closed', description='condition on the lower side')
    left: Side = Field('closed', description='condition on the left side')
    right: Side = Field('closed', description='condition on the right side')
    heads_m: dict[SideName, Level] | None = Field(
        None,
        description='height of the water beyond each open side [m], above any level; default: '
        'the same at all of them',
    )

    @model_validator(mode='after')
    def _check_heads(self) -> Self:
        if self.heads_m is None or set(self.heads_m) == set(self.open_sides):
            return self
        told = ', '.join(self.open_sides) or 'none'
        top = 'top' in self.open_sides and 'top' not in self.heads_m
        by_default = '; the top is open unless you write top: closed' if top else ''
        raise ValueError(
            f'heads_m names {", ".join(self.heads_m) or "no side"}, but the open sides are {told}; '
            f'give the head of each open side, and of no other{by_default}'
        )

    @property
    def open_sides(self) -> tuple[SideName, ...]:
        """The names of the open sides."""
        return tuple(side for side in SIDES if getattr(self, side) == 'open')

    @property
    def all_closed(self) -> bool:
        """Whether no side is open."""
        return not self.open_sides

    @property
    def bodies(self) -> dict[str, WaterBody]:
        """The water beyond the open sides, by side; a head that nobody gave is 0 m."""
        heads = self.heads_m or {}
        return {side: WaterBody(side=side, head_m=heads.get(side, 0.0)) for side in self.open_sides}

    @property
    def raised_heads(self) -> dict[SideName, float]:
        """Heads [m] above the lowest one, by open side; empty if water stands equally high."""
        heads = self.heads_m or {}
        lowest = min(heads.values(), default=0.0)
        raised: dict[SideName, float] = {side: head - lowest for side, head in heads.items()}
        return raised if any(raised.values()) else {}

    @property
    def corners_with_a_jump(self) -> list[tuple[SideName, SideName]]:
        """Pairs of open sides that meet and have different heads: no rate between them is right."""
        raised = self.raised_heads
        corners: list[tuple[SideName, SideName]] = [
            (one, other) for one in ('top', 'bottom') for other in ('left', 'right')
        ]
        return [
            (one, other)
            for one, other in corners
            if one in raised and other in raised and raised[one] != raised[other]
        ]

    def with_water_raised(self, rises: Mapping[SideName, float], *, others: bool = False) -> Self:
        """Return the conditions after the water beyond open sides rose by `rises` [m].

        `others` tells whether other water stands at the sand.

        Raises:
            InputError: the water rises beyond a closed side, or beyond the only open one, where no
                flow depends on it.
        """
        changed = [side for side, rise in rises.items() if rise != 0.0]
        known = ', '.join(self.open_sides) or 'none'
        for side in changed:
            if side not in self.open_sides:
                raise InputError(
                    f'no water stands beyond the {side} side, which is closed; open sides: {known}'
                )
        if changed and len(self.open_sides) < 2 and not others:
            raise InputError(
                f'only the {known} is open, so that no flow depends on the water level there; '
                'open a second side in rig.yaml'
            )
        described = self.heads_m or {}
        heads = {s: described.get(s, 0.0) + rises.get(s, 0.0) for s in self.open_sides}
        return self.model_copy(update={'heads_m': heads if changed else self.heads_m})


class Well(Section):
    """A well: a disc of radius `radius_m` around (`x_m`, `z_m`)."""

    x_m: Number = Field(description='distance of the well from the left edge of the sand [m]')
    z_m: Number = Field(description='height of the well above the lower edge of the sand [m]')
    radius_m: Positive = Field(DEFAULT_WELL_RADIUS, description='radius of the well [m]')
    rate_prior_ml_h: tuple[PositiveRate, PositiveRate] | None = Field(
        None,
        description='90 % interval of a rate that nobody measured [ml/h]: least and greatest value '
        'of the largest rate; a diagnosis fits it',
    )

    @model_validator(mode='after')
    def _is_interval(self) -> Self:
        if self.rate_prior_ml_h is not None and not operator.lt(*self.rate_prior_ml_h):
            low, high = self.rate_prior_ml_h
            raise ValueError(f'rate_prior_ml_h [{low:g}, {high:g}]: the first must be less')
        return self

    @property
    def believed_rate_ml_h(self) -> tuple[float, float] | None:
        """Median [ml/h] and deviation of the log [-] of an unknown rate; None: it is known.

        The rate is lognormal, and `rate_prior_ml_h` its 90 % interval.
        """
        if self.rate_prior_ml_h is None:
            return None
        low, high = map(math.log, self.rate_prior_ml_h)
        return math.exp(0.5 * (low + high)), 0.5 * (high - low) / NormalDist().inv_cdf(0.95)


class Camera(Section):
    """The place of the rig in the photographs; pixels are (column, row)."""

    corners_px: tuple[Pixel, Pixel, Pixel, Pixel] = Field(
        description='upper left, lower left, lower right, upper right corner of the sand '
        'in the photographs, as (column, row) [px]'
    )
    colour_checker_px: tuple[Pixel, Pixel, Pixel, Pixel] | None = Field(
        None,
        description='dark skin, white, black and bluish green corner of the Classic colour chart, '
        'as (column, row) [px]',
    )
    references_px: tuple[PixelPolygon, ...] = Field(
        (),
        description='places that never change, such as a frame, tape or the wall: the corners of '
        'each, as (column, row) [px]; they tell the light and the place of prints and scans',
    )
    curvature: dict[str, Number] = Field(
        default_factory=dict,
        description='terms of the lens and of the bulging front plate, by name [1/px2, px]; '
        'docs/rig.md tells how to measure them',
    )


class EffectDescription(Section):
    """A physical effect by name, with its parameters; a diagnosis adds them to a rig."""

    name: str = Field(description='name of the effect, such as leak')
    parameters: dict[str, Number | str] = Field(
        default_factory=dict, description='numbers and texts by name; docs/effects.md lists them'
    )

    @property
    def water_ml_h(self) -> float:
        """Rate of the water [ml/h] that the effect brings at a place, negative where it takes some.

        Its parameters are then the place `x`, `z` and a `rate`. Other effects bring none.
        """
        rate = self.parameters.get('rate')
        has_place = {'x', 'z'} <= set(self.parameters)
        return float(rate) if has_place and isinstance(rate, int | float) else 0.0
