"""The baseline: everything that is measured once, on photographs without tracer.

    baseline = make_baseline(rig, grid, [jpeg_bytes, ...], calibration=calibration)
    found = concentration_map(jpeg_bytes, baseline)     # photo_to_map.py

A `Baseline` is immutable. All later photographs are compared with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import SMALLEST_DIVISOR
from porotwin_core.geometry.grid import Grid
from porotwin_core.geometry.orientation import UPRIGHT, orientation
from porotwin_core.rig import Camera, Rig
from porotwin_imaging.baseline.baseline_agreement import common_light, refuse_other_sand
from porotwin_imaging.baseline.baseline_mask import (
    BaselineMask,
    baseline_mask,
    texture,
)
from porotwin_imaging.baseline.baseline_subtraction import log_ratio
from porotwin_imaging.baseline.corner_check import odd_corners as find_odd_corners
from porotwin_imaging.geometry.alignment import ReferenceFeatures, align, reference_features
from porotwin_imaging.geometry.corners_and_lens import Geometry
from porotwin_imaging.geometry.frame import LARGE_SHARE, VALIDITY
from porotwin_imaging.geometry.imaging_cost import map_cost, refuse_costly
from porotwin_imaging.geometry.sampling import Sampling, choose_reduction
from porotwin_imaging.light.colour_correction import ColourReference, colour_reference
from porotwin_imaging.light.light_check import refuse_grey_baseline
from porotwin_imaging.light.light_drift import light_drift
from porotwin_imaging.light.light_references import inside_references
from porotwin_imaging.numerics.channels import channel_max
from porotwin_imaging.photograph.linear_light import linear_light
from porotwin_imaging.photograph.photo_file import (
    OVER_EXPOSED,
    DecodedPhoto,
    colour_profile,
    decode,
    photo_size,
)
from porotwin_imaging.photograph.photo_names import baseline_names, named
from porotwin_imaging.tracer.calibration import Calibration

Array = NDArray[Any]

CORNER_SLACK = 0.02
"""Corners of the rig may lie outside the photograph by this share of its width [-]."""
_FEWEST_CELLS = 4
"""Least columns and rows of a map: the light of a photograph varies over it as a quadratic."""


@dataclass(frozen=True)
class Baseline:
    """The reference of all photographs.

    Attributes:
        grid: the grid of the maps.
        photo_size: columns and rows of the photographs [px of the file].
        profile: colour profile of the photographs.
        reduction: ratio of file pixels to decoded pixels.
        sampling: pixels of each cell, from the geometry of the rig.
        features: reference of the alignment.
        mask: parts without visible sand, on the sampling grid, row 0 at the top.
        usable: 1 where sand is visible, uint8, on the sampling grid.
        share: share of each cell that is usable, shape (nz, nx).
        colours: linear red, green, blue on the sampling grid, shape (rows, columns, 3).
        fluctuation: variance of the log ratio between several baselines, shape (nz, nx, 3).
        chart: colours of the chart and the colour matrix.
        calibration: conversion of signal to concentration.
        calibrated: False if `calibration` is only the default.
        sand_factors: factor on the signal of each cell, shape (nz, nx).
        remarks: lines for the operator.
    """

    grid: Grid
    photo_size: tuple[int, int]
    profile: str
    reduction: int
    sampling: Sampling
    features: ReferenceFeatures
    mask: BaselineMask
    usable: NDArray[np.uint8]
    share: Array
    colours: Array
    fluctuation: Array
    chart: ColourReference
    calibration: Calibration
    calibrated: bool
    sand_factors: Array
    remarks: tuple[str, ...]

    def decode(self, data: bytes) -> DecodedPhoto:
        """Return the photograph `data` (bytes of the file), decoded like the baseline.

        Raises:
            InputError: the photograph has another size or colour profile, or cannot be used.
        """
        profile = colour_profile(data)
        if profile != self.profile:
            raise InputError(
                f'photograph has the colour profile {profile}, the baseline {self.profile}; '
                'set the camera to one of them, sRGB at best'
            )
        size = self.photo_size if self.features.scene is None else None
        return _decode(data, size, self.reduction)

    def with_dark_sand(self) -> Self:
        """Return the baseline with dark sand usable: a bright fluid shows there, a dark one not."""
        dark = self.mask.unlit & (channel_max(self.colours) < OVER_EXPOSED)
        sand = ~(self.mask.checker | self.mask.water | self.mask.objects)
        usable = (self.usable > 0) | (dark & sand)
        share = self.sampling.cell_means(usable.astype(np.float32))
        return replace(self, usable=usable.astype(np.uint8), share=share)

    def sand_appearance(self) -> tuple[Array, Array]:
        """Return linear colours (nz, nx, 3) and texture (nz, nx) of the cells, to segment sands."""
        usable = self.usable.astype(np.float32)
        share = np.maximum(self.sampling.cell_means(usable), SMALLEST_DIVISOR)
        colours = self.colours * usable[..., None]
        rough = texture(self.colours).astype(np.float32) * usable
        return (
            self.sampling.cell_means(colours) / share[..., None],
            self.sampling.cell_means(rough) / share,
        )


def make_baseline(
    rig: Rig,
    grid: Grid,
    photographs: Sequence[bytes],
    *,
    calibration: Calibration | None = None,
    names: Sequence[str] = (),
) -> Baseline:
    """Return the baseline of a rig.

    Args:
        rig: the rig with its camera.
        grid: the grid of the maps.
        photographs: photographs without tracer (bytes of the files). The first one defines the
            position of the camera and the light.
        calibration: conversion of signal to concentration; without one a default scale is used.
        names: names of the files, which begin the messages about them; empty: numbers do.

    Raises:
        InputError: there is no photograph, one cannot be used or differs from the first, the first
            is grey although the calibration is coloured, the rig has no camera, the grid is too
            coarse, the maps cost too much, or the calibration is of another rig.
    """
    if not photographs:
        raise InputError('no baseline photograph: give one taken before the injection')
    if min(grid.nx, grid.nz) < _FEWEST_CELLS:
        raise InputError(
            f'grid {grid} is too coarse for photographs: it needs {_FEWEST_CELLS} columns and rows '
            f'or more; {rig.default_grid()} has cells of 5 mm'
        )
    used_calibration = calibration or Calibration()
    used_calibration.check_rig(rig)
    doubt = calibration.doubt_about(rig) if calibration else None
    geometry = Geometry.of(rig)
    camera = rig.camera
    assert camera is not None  # Geometry.of has checked it
    called = baseline_names(names, len(photographs))
    with named(called[0]):
        size = photo_size(photographs[0])
        refuse_corners_outside(camera, size)
    refuse_costly(map_cost(rig, grid, size), grid)
    reduction = choose_reduction(geometry, grid, size[0])
    pictures: list[NDArray[np.uint8]] = []
    for name, data in zip(called, photographs, strict=True):
        with named(name):
            same = None if pictures and camera.references_px else size
            pictures.append(_decode(data, same, reduction).pixels)
    first = pictures[0]
    sampling = Sampling.of(geometry, grid, reduction)
    with named(called[0]):
        refuse_grey_baseline(first, used_calibration.signal)
        off = find_odd_corners(rig, first, size, reduction)
        odd_corners = [str(off)] if off else []
        features = reference_features(
            first,
            _inside_rig(camera, first.shape, reduction),
            inside_references(first.shape, camera, reduction),
        )
        first_colours = linear_light(sampling.sample(first))
        mask = baseline_mask(
            first_colours,
            width_m=grid.width,
            checker=_checker_on_sampling(camera, geometry, sampling),
        )
        rows, columns = mask.usable.shape
        usable = mask.usable & used_calibration.shown(mask.usable.shape)
        usable &= rig.wet_sand(rig.grid(columns, rows))[::-1]
        share = sampling.cell_means(usable.astype(np.float32))
        if not (share > VALIDITY.least_visible_share).any():
            raise InputError(_no_sand(odd_corners))
        over_exposed = _remarks_on_exposure(first_colours)
    chart, remarks = colour_reference(first, camera, reduction)
    sampled = [first_colours, *_sampled(pictures[1:], called[1:], sampling, features)]
    colours, fluctuation = _average(sampled, called, sampling, usable, share)
    return Baseline(
        grid=grid,
        photo_size=size,
        profile=colour_profile(photographs[0]),
        reduction=reduction,
        sampling=sampling,
        features=features,
        mask=mask,
        usable=usable.astype(np.uint8),
        share=share,
        colours=colours,
        fluctuation=fluctuation,
        chart=chart,
        calibration=used_calibration,
        calibrated=calibration is not None,
        sand_factors=used_calibration.factor_map(grid),
        remarks=(
            *([str(doubt)] if doubt else []),
            *odd_corners,
            *remarks,
            *over_exposed,
            *_remarks_on_files(photographs),
        ),
    )


def _decode(data: bytes, size: tuple[int, int] | None, reduction: int) -> DecodedPhoto:
    """Return the decoded photograph; raise InputError if its size is not `size`; None: any is."""
    found = photo_size(data)
    if size is None or found == size:
        return decode(data, reduction)
    if found == size[::-1]:
        raise InputError(
            f'photograph is {found[0]} x {found[1]} px, turned by 90 degrees against the baseline; '
            'turn it back, with its pixels and not only its EXIF orientation'
        )
    raise InputError(
        f'photograph is {found[0]} x {found[1]} px, the baseline {size[0]} x {size[1]} px; '
        'keep the camera as it is or take a new baseline; for prints and scans of another crop, '
        'name places that never change in camera.references_px'
    )


def refuse_corners_outside(camera: Camera, size: tuple[int, int]) -> None:
    """Raise InputError if the corners of the rig lie outside the photograph."""
    corners = np.array(camera.corners_px)
    slack = CORNER_SLACK * size[0]

    def outside(width: int, height: int) -> bool:
        return bool((corners < -slack).any() or (corners > np.array([width, height]) + slack).any())

    if not outside(*size):
        return
    remedy = 'correct rig.yaml or use photographs of this rig'
    if not outside(*size[::-1]):  # the pixels are taken as the sensor has read them
        remedy = (
            'they fit a photograph that is turned by 90 degrees. Does an EXIF orientation turn it '
            'in a viewer only? Give the corners in the file as it is stored, or store it turned'
        )
    raise InputError(
        f'photograph is {size[0]} x {size[1]} px, but camera.corners_px reach to '
        f'{corners.max(axis=0).tolist()}; {remedy}'
    )


def _no_sand(odd_corners: Sequence[str]) -> str:
    """Return the message that a baseline shows no sand; its corners may be the cause."""
    cause = (
        odd_corners[0]
        if odd_corners
        else (
            'is it dark, or something in front of it, or are camera.corners_px in rig.yaml wrong? '
            './porotwin check draws them over it'
        )
    )
    return f'baseline shows no sand: {cause}'


def _inside_rig(camera: Camera, shape: tuple[int, ...], reduction: int) -> NDArray[np.bool_]:
    """Return True inside the quadrilateral of the rig, in decoded pixels."""
    corners = np.array(camera.corners_px) / reduction
    inside = np.zeros(shape[:2], np.uint8)
    cv2.fillPoly(inside, [np.rint(corners).astype(np.int32)], 1)
    return inside.astype(bool)


def _checker_on_sampling(camera: Camera, geometry: Geometry, sampling: Sampling) -> Array | None:
    """Return the corners of the chart as (column, row) on the sampling grid, (4, 2), or None."""
    if camera.colour_checker_px is None:
        return None
    x, z = geometry.to_metres(*np.array(camera.colour_checker_px).T)
    rows, columns = sampling.shape
    grid = sampling.grid
    return np.stack([x / grid.width * columns, (1 - z / grid.height) * rows], axis=1)


def _sampled(
    pictures: Sequence[NDArray[np.uint8]],
    names: Sequence[str],
    sampling: Sampling,
    features: ReferenceFeatures,
) -> list[Array]:
    """Return the linear colours of further pictures on the sampling grid, aligned to the first.

    Raises:
        InputError: one cannot be aligned; the message begins with its name.
    """
    sampled = []
    for name, pixels in zip(names, pictures, strict=True):
        with named(name):
            alignment = align(pixels, features)
        sampled.append(linear_light(sampling.sample(pixels, alignment.homography)))
    return sampled


def _average(
    sampled: Sequence[Array],
    names: Sequence[str],
    sampling: Sampling,
    usable: NDArray[np.bool_],
    share: Array,
) -> tuple[Array, Array]:
    """Return the mean of sampled baselines in the light of the first, and their fluctuation.

    The fluctuation (nz, nx, 3) is the variance of the log ratio of a single photograph.

    Raises:
        InputError: one shows other sand than the first; the message begins with its name.
    """
    if len(sampled) == 1:
        return sampled[0], np.zeros((*sampling.grid.shape, 3), np.float32)
    visible = share > VALIDITY.least_visible_share
    means = [sampling.cell_means(one * usable[..., None]) for one in sampled]
    ratios, same_light = [np.zeros_like(means[0])], [sampled[0]]
    for name, mean, one in zip(names[1:], means[1:], sampled[1:], strict=True):
        ratio = log_ratio(mean, means[0])
        drift = light_drift(ratio, share, common_light(ratio, visible))
        ratios.append(drift.removed_from(ratio))
        with named(name):
            refuse_other_sand(ratios[-1], visible, names[0])
        same_light.append(one * np.exp(-drift.log_gain.mean(axis=(0, 1))))
    return np.mean(same_light, axis=0).astype(np.float32), np.var(ratios, axis=0, ddof=1)


def _remarks_on_exposure(colours: Array) -> list[str]:
    """Return a remark if the baseline is over-exposed in part; `colours` are those sampled.

    Raises:
        InputError: too much of the rig is over-exposed.
    """
    clipped = channel_max(colours) >= OVER_EXPOSED
    share = float(clipped.mean())
    if share > VALIDITY.most_left_out:
        raise InputError(
            f'baseline is over-exposed on {100 * share:.0f} % of the rig; shorten the exposure'
        )
    if share < LARGE_SHARE:
        return []
    return [f'{100 * share:.1f} % of the rig is over-exposed: tracer is not seen there']


def _remarks_on_files(photographs: Sequence[bytes]) -> list[str]:
    """Return remarks about the orientation and the number of the baseline photographs."""
    remarks = []
    turned = orientation(photographs[0])
    if turned != UPRIGHT:
        remarks.append(
            f'EXIF orientation {turned} is not applied: camera.corners_px must count pixels as '
            'the file holds them, not as a viewer that turns the photograph shows them'
        )
    if len(photographs) == 1:
        remarks.append('one baseline: the fluctuation between photographs is not known')
    return remarks
