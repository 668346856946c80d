"""The sands of `rig.yaml` and their places, and measured depths."""

import itertools
from typing import Self

import pydantic
from pydantic import Field

from porotwin_core.rig.numbers import Number, Positive, PositiveShare
from porotwin_core.rig.sections import Point, Polygon, Section

LEAST_INTERFACE_POINTS = 2
"""Fewest points of an interface that is no horizontal line."""


class Sand(Section):
    """One kind of sand. Its permeability is given as such, or as a hydraulic conductivity.

    The conductivity is K = k rho g / mu of the water in the rig, with its density and viscosity.
    """

    porosity: PositiveShare = Field(description='volume of the pores per volume of sand [-]')
    permeability_m2: Positive | None = Field(
        None, description='permeability [m2]; 1 darcy is 9.87e-13 m2'
    )
    hydraulic_conductivity_m_s: Positive | None = Field(
        None, description='hydraulic conductivity for the water in the rig [m/s]'
    )

    @pydantic.model_validator(mode='after')
    def _has_one_permeability(self) -> Self:
        if (self.permeability_m2 is None) == (self.hydraulic_conductivity_m_s is None):
            raise ValueError('give either permeability_m2 or hydraulic_conductivity_m_s')
        return self


class SandLayer(Section):
    """A layer of one sand. It reaches from the layers below up to its top."""

    sand: str = Field(description='name of a sand')
    top_m: Positive | tuple[Point, ...] | None = Field(
        None,
        description='upper interface: a height [m], or points (x, z) [m] joined by straight '
        'lines and level beyond the ends; the last layer has none, it fills the rig',
    )

    @pydantic.field_validator('top_m')
    @classmethod
    def _runs_to_the_right(
        cls, top: float | tuple[Point, ...] | None
    ) -> float | tuple[Point, ...] | None:
        if isinstance(top, tuple):
            if len(top) < LEAST_INTERFACE_POINTS:
                raise ValueError('needs a height, or at least two points (x, z)')
            x = [point[0] for point in top]
            if any(right <= left for left, right in itertools.pairwise(x)):
                raise ValueError('the points (x, z) must run from left to right: sort them by x')
        return top


class SandPolygon(Section):
    """A polygon filled with one sand, such as a fault or a lens."""

    sand: str = Field(description='name of a sand')
    corners_m: Polygon = Field(description='corners (x, z) of the polygon [m], in their order')


class SandImage(Section):
    """A picture of the whole rig with a colour for every sand, row 0 at the top."""

    file: str = Field(description='PNG or other picture, relative to the folder of rig.yaml')
    legend: dict[str, str] = Field(
        min_length=1, description="sand of each colour, such as {'#c08040': coarse}"
    )


class DepthPoints(Section):
    """The depth at measured points; between them it is linear on triangles (Delaunay).

    Beyond the outermost points the nearest point counts.
    """

    points: tuple[tuple[Number, Number, Positive], ...] = Field(
        min_length=1, description='(x, z, depth) of every measured point [m]'
    )


class DepthPointsFile(Section):
    """The depth at measured points in a CSV file with the columns x_m, z_m, depth_m."""

    points_file: str = Field(
        description='CSV file with the columns x_m,z_m,depth_m, relative to the folder of rig.yaml'
    )
