"""Finds odd and impossible values in a description, with one remark for each."""

import itertools
import math
import unicodedata
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from porotwin_core.basis.plausibility import (
    CONDUCTIVITY,
    DENSITY,
    DEPTH,
    PERMEABILITY,
    POROSITY,
    VISCOSITY,
    WELL_RADIUS,
    WIDTH,
    PlausibleRange,
    rate_remark,
)
from porotwin_core.basis.remark import Remark
from porotwin_core.basis.units import ML
from porotwin_core.geometry.polygons import crosses_itself, inside, signed_area
from porotwin_core.rig.description import Rig
from porotwin_core.rig.sand_drawing import sand_raster
from porotwin_core.rig.sand_sections import DepthPoints
from porotwin_core.rig.sections import LEAST_CORNERS, Pixel

DEEP = 0.5
"""Depth over the smaller side above which a rig is no longer flat, as the model assumes."""

LARGE_WELL = 0.1
"""Radius of a well over the smaller side of the rig above which it is odd."""

SAME_PLACE_M = 1e-6
"""Distance of two wells below which they are one place [m]."""

MOST_DEPTH_RATIO = 3.0
"""Measured depth over the median of all that is odd: plates bulge by a half at most."""

NEAR = 0.05
"""Distance of a place beyond the edge of the rig, over its size, that passes for a slip."""

BARRIER = 1e-2
"""A sand that conducts less than this share of another one is a barrier, such as clay: that its
number is below those of sands is no mistake."""

TIGHT = 1e-3
"""Permeability at a well over the greatest of the rig below which the well pumps next to nothing.
"""

LONG_HORIZON_MIN = 60.0
"""Plans look ahead for less than this [min]."""

STEEP = 0.3
"""Gradient of the head [-] between opposite sides that no laboratory flow has."""

MOST_GRADIENT = 10.0
"""Difference of two heads over the distance of their sides above which it is refused: sand would be
washed out, and a prediction takes minutes."""

MOST_USUAL_FACTOR = 10.0
"""Factor on a rate, a depth or a porosity [-] above which it is probably a percentage."""

IN_ZONE_SAMPLES = 200
"""Places along each side of the rig, for the search of a zone."""


def remarks_about(rig: Rig) -> tuple[Remark, ...]:
    """Return all remarks about `rig`, the impossible values first."""
    found = [
        *_numbers(rig),
        *_measured_depths(rig),
        *_shape(rig),
        *remarks_about_heads(rig),
        *_water(rig),
        *_sands(rig),
        *_wells(rig),
        *_tight_wells(rig),
        *_corners(rig),
        *_leaks(rig),
        *_factors(rig),
        *_control(rig),
        *_repeated_effects(rig),
    ]
    return tuple(sorted(found, key=lambda remark: not remark.refused))


def _in_range(plausible: PlausibleRange, key: str, *values: float) -> Iterator[Remark]:
    """Yield the remark about the first of `values` outside the range."""
    for value in values:
        remark = plausible.remark(key, value)
        if remark is not None:
            yield remark
            return


def _extremes(value: Any) -> tuple[float, ...]:
    return tuple({float(np.min(value)), float(np.max(value))})


def _numbers(rig: Rig) -> Iterator[Remark]:
    yield from _in_range(WIDTH, 'width_m', rig.width_m)
    yield from _in_range(WIDTH, 'height_m', rig.height_m)
    yield from _in_range(DEPTH, 'depth_m', *_extremes(rig.nominal_map('depth_m')))
    yield from _in_range(VISCOSITY, 'viscosity_pa_s', rig.viscosity_pa_s)
    yield from _in_range(DENSITY, 'density_kg_m3', rig.density_kg_m3)
    if rig.hydraulic_conductivity_m_s is not None:
        key = 'hydraulic_conductivity_m_s'
        yield from _in_range(CONDUCTIVITY, key, rig.hydraulic_conductivity_m_s)
    elif not rig.sands:
        permeability = _extremes(rig.nominal_map('permeability_m2'))
        yield from _in_range(PERMEABILITY, 'permeability_m2', *permeability)
    if not rig.sands:
        yield from _in_range(POROSITY, 'porosity', *_extremes(rig.nominal_map('porosity')))


def _measured_depths(rig: Rig) -> Iterator[Remark]:
    if not isinstance(rig.depth_m, DepthPoints):
        return
    places: dict[tuple[float, float], float] = {}
    for x, z, depth in rig.depth_m.points:
        place = f'({x:g}, {z:g}) m'
        if not (
            -NEAR * rig.width_m <= x <= (1 + NEAR) * rig.width_m
            and -NEAR * rig.height_m <= z <= (1 + NEAR) * rig.height_m
        ):
            size = f'the rig of {rig.width_m:g} m x {rig.height_m:g} m'
            yield Remark(
                'depth_m.points', place, f'it lies outside {size}', 'write x, z, depth in m'
            )
            return
        if places.setdefault((x, z), depth) != depth:
            yield Remark('depth_m.points', place, 'it has two depths', 'keep one of them')
            return
    middle = float(np.median(list(places.values())))
    for (x, z), depth in places.items():
        if not 1.0 / MOST_DEPTH_RATIO <= depth / middle <= MOST_DEPTH_RATIO:
            why = f'most points are about {middle:.3g} m deep'
            yield Remark('depth_m.points', f'{depth:g} m at ({x:g}, {z:g}) m', why, 'correct one')
            return


def _shape(rig: Rig) -> Iterator[Remark]:
    depth = float(np.max(rig.nominal_map('depth_m')))
    if depth > DEEP * min(rig.width_m, rig.height_m):
        yield Remark(
            'depth_m',
            f'{depth:g} m',
            f'the model is flat, but the rig of {rig.width_m:g} m x {rig.height_m:g} m is not',
            'compare the three lengths and their units',
        )


def remarks_about_heads(rig: Rig) -> Iterator[Remark]:
    """Yield remarks about heads that drive no water, too much of it, or meet in a corner."""
    given, raised = rig.boundaries.heads_m, rig.boundaries.raised_heads
    key = 'boundaries.heads_m'
    if given and len(given) == 1:
        why = 'only differences between open sides count, so that one head does nothing'
        remedy = 'remove it, or give the head of a second open side'
        yield Remark(key, f'{min(given.values()):g} m', why, remedy)
    elif given and not raised:
        why = 'water flows only between open sides with different heads'
        yield Remark(key, f'{min(given.values()):g} m everywhere', why, 'correct or remove it')
    for one, other in rig.boundaries.corners_with_a_jump:
        apart = abs(raised[one] - raised[other])
        why = f'the {one} and the {other} side meet in a corner, where their heads jump'
        remedy = (
            'the rate between them grows with the number of cells: trust no flow near '
            'this corner, or close one of the two sides'
        )
        yield Remark(key, f'{apart:g} m apart', why, remedy)
    for one, other, size in (('left', 'right', rig.width_m), ('bottom', 'top', rig.height_m)):
        apart = abs(raised.get(one, 0.0) - raised.get(other, 0.0))
        if one in raised and other in raised and apart > STEEP * size:
            why = f'the water falls by {apart:g} m over the {size:g} m between the two sides'
            far = apart > MOST_GRADIENT * size
            yield Remark(key, f'{apart:g} m apart', why, 'are they in cm? write m', refused=far)


def _water(rig: Rig) -> Iterator[Remark]:
    """Yield remarks about canals outside the sand, wells in them, heads far apart, and rates."""
    heads = {name: b.head_m for name, b in rig.water_bodies.items() if b.head_m is not None}
    if rig.water and heads:
        low, high = min(heads, key=heads.__getitem__), max(heads, key=heads.__getitem__)
        apart, size = heads[high] - heads[low], max(rig.width_m, rig.height_m)
        if apart > STEEP * size:
            why = f"it is {apart:g} m higher than '{low}', in a rig of {size:g} m"
            far = apart > MOST_GRADIENT * size
            shown = f'{heads[high]:g} m'
            yield Remark(f'water.{high}.head_m', shown, why, 'is it in cm? write m', refused=far)
    for name, body in rig.water.items():
        key = f'water.{name}'
        remark = rate_remark(f'{key}.rate_ml_h', body.rate_ml_h or 0.0, rig.pore_volume)
        if body.rate_ml_h and remark is not None:
            yield remark
        if body.corners_m is None:
            continue
        yield from _outline(rig, f'{key}.corners_m', body.corners_m)
        wells = np.array([(well.x_m, well.z_m) for well in rig.wells.values()]).reshape(-1, 2)
        for well, within in zip(rig.wells, inside(wells, np.array(body.corners_m)), strict=True):
            if within:
                why = f"it lies in the open water '{name}'"
                yield Remark(f'wells.{well}', '', why, 'move it into the sand', refused=True)


def _sands(rig: Rig) -> Iterator[Remark]:
    for name, sand in rig.sands.items():
        yield from _in_range(POROSITY, f'sands.{name}.porosity', sand.porosity)
    yield from _conducting(rig, PERMEABILITY, 'permeability_m2')
    yield from _conducting(rig, CONDUCTIVITY, 'hydraulic_conductivity_m_s')
    for number, layer in enumerate(rig.sand_layers[:-1], start=1):
        heights = [z for _, z in layer.top_m] if isinstance(layer.top_m, tuple) else [layer.top_m]
        if max(z for z in heights if z is not None) > rig.height_m:
            yield Remark(
                f'sand_layers.{number}.top_m',
                f'{max(z for z in heights if z is not None):g} m',
                f'the rig ends at {rig.height_m:g} m',
                'compare the heights with height_m, both in m',
            )
    for number, polygon in enumerate(rig.sand_polygons, start=1):
        yield from _outline(rig, f'sand_polygons.{number}.corners_m', polygon.corners_m)
    yield from _unused_sands(rig)


def _conducting(rig: Rig, plausible: PlausibleRange, key: str) -> Iterator[Remark]:
    """Yield remarks about the `key` of sands: a barrier beside other sand is refused or right."""
    values = {name: getattr(sand, key) for name, sand in rig.sands.items()}
    given = {name: value for name, value in values.items() if value is not None}
    for name, value in given.items():
        is_barrier = value < BARRIER * max(given.values())
        for remark in _in_range(plausible, f'sands.{name}.{key}', value):
            if remark.refused or not is_barrier:
                yield remark


def _unused_sands(rig: Rig) -> Iterator[Remark]:
    porosity, permeability = rig.nominal_map('porosity'), rig.nominal_map('permeability_m2')
    for name, sand in rig.sands.items():
        if name not in rig.placed_sands:
            yield Remark(f'sands.{name}', '', 'this sand has no place', 'place or remove it')
        elif not np.any(
            (porosity == sand.porosity) & (permeability == rig.permeability_of_sand(name))
        ):
            squares = sand_raster(rig.width_m, rig.height_m)
            width = f'{1e3 * squares.dx:.2g} mm'
            why = f'it fills no square of the drawn rig; squares are {width} wide'
            yield Remark(f'sands.{name}', '', why, f'make it at least {width} thick, or remove it')


def _wells(rig: Rig) -> Iterator[Remark]:
    if not rig.wells:
        yield Remark('wells', '{}', 'no water can be pumped', 'name the wells, each with x_m, z_m')
    smaller = min(rig.width_m, rig.height_m)
    for name, well in rig.wells.items():
        key = f'wells.{name}.radius_m'
        radius = well.radius_m
        yield from _in_range(WELL_RADIUS, key, radius)
        room = min(well.x_m, rig.width_m - well.x_m, well.z_m, rig.height_m - well.z_m)
        if radius > LARGE_WELL * smaller:
            why = f'a tenth of the rig is {LARGE_WELL * smaller:g} m'
            yield Remark(key, f'{radius:g} m', why, 'give the radius of the tube in m')
        elif room < radius:
            place = f'({well.x_m:g}, {well.z_m:g}) m'
            why = f'its disc of {radius:g} m reaches into the wall {room:g} m away'
            yield Remark(f'wells.{name}', place, why, 'move it into the sand or reduce radius_m')
    for (one, first), (other, second) in itertools.combinations(rig.wells.items(), 2):
        yield from _pair(one, first, other, second)


def _tight_wells(rig: Rig) -> Iterator[Remark]:
    """Yield a remark about every well whose disc lies in hardly permeable sand alone."""
    permeability = rig.nominal_map('permeability_m2')
    if isinstance(permeability, float):
        return
    most = float(permeability.max())
    rows, columns = permeability.shape
    for name, well in rig.wells.items():
        high = _squares(well.z_m, well.radius_m, rig.height_m, rows)
        wide = _squares(well.x_m, well.radius_m, rig.width_m, columns)
        here = float(permeability[high, wide].max())
        if here < TIGHT * most:
            sands = [f" '{sand}'" for sand in rig.sands if rig.permeability_of_sand(sand) == here]
            yield Remark(
                f'wells.{name}',
                f'({well.x_m:g}, {well.z_m:g}) m',
                f'the sand{"".join(sands[:1])} there has {here:.2g} m2, the most permeable one '
                f'{most:.2g} m2, so that hardly any water reaches the well',
                'move it into permeable sand, or correct this permeability and its unit',
            )


def _squares(place: float, radius: float, size: float, count: int) -> slice:
    """Return the squares of a side of `size` [m] in `count` that a disc at `place` reaches."""
    first, last = (int(edge / size * count) for edge in (place - radius, place + radius))
    return slice(max(first, 0), last + 1)


def _pair(one: str, first: Any, other: str, second: Any) -> Iterator[Remark]:
    if _plain(one) == _plain(other):
        why = 'the two names differ by capital letters or by the coding of accents only'
        yield Remark(f'wells.{other}', '', f'{why}, as in {one}', 'rename one of them')
    distance = math.hypot(first.x_m - second.x_m, first.z_m - second.z_m)
    if distance < first.radius_m + second.radius_m:
        same = distance < SAME_PLACE_M
        yield Remark(
            f'wells.{other}',
            f'({second.x_m:g}, {second.z_m:g}) m',
            f"it {'stands at the same place as' if same else 'overlaps'} '{one}'",
            'correct one place, or make one well of both',
            refused=same,
        )


def _plain(name: str) -> str:
    """Return a name as a person reads it: small letters, each accent with its letter."""
    return unicodedata.normalize('NFC', name).lower()


def _corners(rig: Rig) -> Iterator[Remark]:
    if rig.camera is None:
        return
    order = 'upper left, lower left, lower right, upper right'
    chart = 'dark skin, white, black, bluish green'
    yield from _quadrangle('camera.corners_px', rig.camera.corners_px, order)
    if rig.camera.colour_checker_px is not None:
        yield from _quadrangle('camera.colour_checker_px', rig.camera.colour_checker_px, chart)
    upper_left, lower_left, lower_right, _ = rig.camera.corners_px
    sideways = abs(lower_left[1] - upper_left[1]) < abs(lower_left[0] - upper_left[0])
    if sideways or lower_left[1] < upper_left[1] or lower_right[0] < lower_left[0]:
        yield Remark(
            'camera.corners_px',
            '',
            'by this order the rig lies on its side or upside down in the photographs',
            f'give {order}, unless the camera is turned',
        )


def _quadrangle(key: str, corners: tuple[Pixel, ...], order: str) -> Iterator[Remark]:
    polygon = np.array(corners)
    turns = [_turn(*(polygon[(index + step) % 4] for step in range(3))) for index in range(4)]
    if any(turn == 0 for turn in turns) or len({turn > 0 for turn in turns}) > 1:
        why = 'the four corners make no quadrangle without a dent'
        yield Remark(key, '', why, f'give {order} as (column, row)', refused=True)
    elif signed_area(polygon) > 0:  # rows count downward: this order turns the other way round
        why = 'in this order the corners show a mirror image'
        yield Remark(key, '', why, f'give {order} as (column, row)', refused=True)


def _turn(a: Any, b: Any, c: Any) -> float:
    return float((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]))


def _leaks(rig: Rig) -> Iterator[Remark]:
    for effect in rig.effects:
        remark = rate_remark(f'effects: {effect.name}: rate', effect.water_ml_h, rig.pore_volume)
        if remark is not None:
            yield remark


def _factors(rig: Rig) -> Iterator[Remark]:
    """Remark factors of pumps, depths and porosities that are probably percentages."""
    for effect in rig.effects:
        factor = effect.parameters.get('factor')
        if isinstance(factor, int | float) and factor > MOST_USUAL_FACTOR:
            yield Remark(
                f'effects: {effect.name}: factor',
                f'{factor:g}',
                f'{factor:g} times the nominal value',
                f'write {factor / 100:g} if {factor:g} % is meant',
            )


def _control(rig: Rig) -> Iterator[Remark]:
    control = rig.control
    if control is None:
        return
    pores = rig.pore_volume
    limits = {
        'control.max_rate_ml_h': control.max_rate_ml_h,
        'control.max_total_rate_ml_h': control.max_total_rate_ml_h,
    }
    fixed = {
        f'control.fixed.{name}.rate_ml_h': well.rate_ml_h for name, well in control.fixed.items()
    }
    for key, rate in {**limits, **fixed}.items():
        remark = rate_remark(key, rate, pores)
        if remark is not None:
            yield remark
    injected = sum(max(rate, 0.0) for rate in fixed.values())
    if injected > control.max_total_rate_ml_h:
        yield Remark(
            'control.max_total_rate_ml_h',
            f'{control.max_total_rate_ml_h:g} ml/h',
            f'the fixed wells inject {injected:g} ml/h, more than the control wells may',
            'raise it if the tracer cannot be held',
        )
    if control.max_rate_ml_h > control.max_total_rate_ml_h:
        yield Remark(
            'control.max_rate_ml_h',
            f'{control.max_rate_ml_h:g} ml/h',
            f'no well can reach it below the sum of {control.max_total_rate_ml_h:g} ml/h',
            'exchange the two limits or correct one',
        )
    if control.fuzziness_m > max(rig.width_m, rig.height_m):
        size = f'the rig is {max(rig.width_m, rig.height_m):g} m long'
        shown = f'{control.fuzziness_m:g} m'
        yield Remark('control.fuzziness_m', shown, size, 'the whole rig then counts as the zone')
    most_dose = ML * pores * LONG_HORIZON_MIN
    if (cost := control.change_cost_ml_min or 0.0) > most_dose:
        why = f'no order can gain more than {most_dose:.2g} ml min, all of the rig for an hour'
        yield Remark('control.change_cost_ml_min', f'{cost:g}', why, 'the twin would never order')
    if not control.wells:
        yield Remark('control.wells', '[]', 'the twin may set no well', 'name the control wells')
    zones = [('control.disallowed_zone_m', control.disallowed_zone_m)]
    zones += _zones('control.objective', control.objective.parameters)
    for key, zone in zones:
        if zone:
            yield from _outline(rig, key, zone)


def _zones(section: str, parameters: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the key and the corners of every zone of an objective and of its parts."""
    for key, value in parameters.items():
        where = f'{section}.{key}'
        if key.endswith('zone_m') or key == 'tracer_m':
            yield where, value
        elif key in ('zones_m', 'parts') and isinstance(value, list | tuple):
            for number, one in enumerate(value):
                if key == 'zones_m':
                    yield f'{where}.{number}', one
                elif isinstance(one, dict):
                    yield from _zones(f'{where}.{number}', one)


def _outline(rig: Rig, key: str, corners: Any) -> Iterator[Remark]:
    """Yield the remarks about a polygon (x, z) [m] that should lie in the rig."""
    try:
        polygon = np.array(corners, dtype=float).reshape(-1, 2)
    except (TypeError, ValueError):
        return  # the reader of the parameter refuses it
    if len(polygon) < LEAST_CORNERS:
        return
    size = f'the rig of {rig.width_m:g} m x {rig.height_m:g} m'
    if crosses_itself(polygon):
        why = 'the outline crosses itself'
        yield Remark(key, '', why, 'give the corners in their order round the zone', refused=True)
        return
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    extent = f'{low[0]:g} to {high[0]:g} m in x, {low[1]:g} to {high[1]:g} m in z'
    within = (low >= 0.0).all() and (high <= np.array([rig.width_m, rig.height_m])).all()
    if not _covers(rig, polygon):
        why = f'it covers nothing of {size}'
        remedy = 'give the corners (x, z) in m from the lower left corner'
        if within:
            why, remedy = f'it is too thin to cover a place of {size}', 'make it thicker'
        yield Remark(key, extent, why, remedy, refused=True)
    elif (high > 1.02 * np.array([rig.width_m, rig.height_m])).any() or (low < -0.02).any():
        yield Remark(key, extent, f'it reaches beyond {size}', 'correct it if that is a slip')


def _covers(rig: Rig, polygon: Any) -> bool:
    samples = (np.arange(IN_ZONE_SAMPLES) + 0.5) / IN_ZONE_SAMPLES
    x, z = np.meshgrid(samples * rig.width_m, samples * rig.height_m)
    return bool(inside(np.column_stack([x.ravel(), z.ravel()]), polygon).any())


def _repeated_effects(rig: Rig) -> Iterator[Remark]:
    for number, effect in enumerate(rig.effects):
        if effect in rig.effects[:number]:
            why = 'it repeats an effect above with the same parameters, and both act'
            yield Remark(f'effects.{number + 1}', effect.name, why, 'keep one of them')
