"""Messages into the types of the algorithms, without ROS.

A message is any object with the fields of its interface: an instance of a generated class, or a
message that was read from a bag. Every message is checked here once: array sizes against grids,
names, finite numbers.
"""

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import MINUTE_S, ML, to_ml_h, to_ml_min
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.zone_shapes import PictureZone
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.wells import RateStep, WellRate
from porotwin_core.rig import SIDES, EffectDescription, ObjectiveDescription, Rig, rig_from_maps
from porotwin_core.ros.foreign_words import in_short
from porotwin_core.ros.nested_parameters import VALUE_FIELDS, json_object, nested

RIG_FRAME = 'rig'
"""Frame of maps: origin at the lower left corner of the sand, x right, z up, y into the rig."""

ZONE_FILE = {'file': 'zone.nc'}
"""Reference to a zone that came with a message; `write_rig` writes the file."""

LOWEST_CONCENTRATION, HIGHEST_CONCENTRATION = -2.0, 3.0
"""Range of the values of a map [-]. Noise and an uncalibrated scale lead to -0.5 and 1.5 (settings
of imaging), the largest correction of COSTA to -1.5 and 2.5. Numbers beyond the range are no
concentrations."""


def nanoseconds_from_msg(stamp: Any) -> int:
    """Return the time of a stamp [ns], exactly."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def time_from_msg(stamp: Any) -> float:
    """Return the time of a stamp [s], since the epoch of the clock that made it."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def seconds_from_msg(duration: Any) -> float:
    """Return a span of time [s]; a number of a bag that was recorded before version 0.3 stays."""
    return float(duration) if isinstance(duration, float) else time_from_msg(duration)


def path_from_msg(text: str) -> Path:
    """Return the path in a request.

    Raises:
        InputError: no file can have it, or one may not look there.
    """
    try:
        with suppress(FileNotFoundError):
            Path(text).lstat()
    except (OSError, ValueError) as error:  # the latter: a zero in it
        reason = getattr(error, 'strerror', None) or error
        raise InputError(
            f'{in_short(text)!r}: no path ({reason}); name another file or folder'
        ) from None
    return Path(text)


def grid_from_msg(message: Any) -> Grid:
    """Return the grid of a message.

    Raises:
        InputError: no cells, or a size that is not positive.
    """
    return Grid(message.nx, message.nz, message.width, message.height)


def _values(kind: str, values: Any, grid: Grid, dtype: type) -> FloatArray:
    """Return the `values` of a message, an array or a buffer, as a map (nz, nx) on `grid`."""
    if len(values) != grid.nx * grid.nz:
        raise InputError(
            f'{kind} has {len(values)} values on a grid of {grid.nx} x {grid.nz}; '
            f'send {grid.nx * grid.nz}, row-major from the lower left'
        )
    return np.frombuffer(values, dtype=dtype).reshape(grid.shape)


def tracer_from_msg(message: Any) -> tuple[FloatArray, Grid]:
    """Return the map (nz, nx) [-] in double precision, and its grid; NaN where nothing was seen.

    Raises:
        InputError: the grid is wrong, the number of values does not fit it, the map is in another
            frame, or a value is infinite or no concentration.
    """
    grid = grid_from_msg(message.grid)
    values = _values('tracer field', message.concentration, grid, np.float32)
    frame = message.header.frame_id
    if frame not in ('', RIG_FRAME):
        raise InputError(f"tracer field in the frame '{frame}'; send it in '{RIG_FRAME}'")
    wrong = values[(values < LOWEST_CONCENTRATION) | (values > HIGHEST_CONCENTRATION)]
    if wrong.size:
        raise InputError(
            f'tracer field with {wrong[0]:g} in {wrong.size} cells; a concentration lies between '
            '0 and 1, NaN where nothing was seen'
        )
    return values.astype(np.float64), grid


def deviation_from_msg(values: Any, grid: Grid) -> FloatArray | None:
    """Return a map (nz, nx) of standard deviations [-] in double precision; None if not known.

    Args:
        values: field `deviation` or `systematic` of a state, empty if not known.
        grid: the grid of its concentrations.

    Raises:
        InputError: the number of values does not fit the grid, or one is negative or infinite.
    """
    if len(values) == 0:
        return None
    deviation = _values('deviation', values, grid, np.float32)
    wrong = deviation[(deviation < 0.0) | np.isinf(deviation)]
    if wrong.size:
        raise InputError(
            f'deviation of {wrong[0]:g} in {wrong.size} cells; a standard deviation is 0 or more, '
            'NaN where nothing was seen'
        )
    return deviation.astype(np.float64)


def source_from_msg(message: Any) -> tuple[FloatArray, Grid]:
    """Return the tracer source (nz, nx) [1/s] and its grid.

    Raises:
        InputError: the grid is wrong, the number of values does not fit it, or one is not finite.
    """
    grid = grid_from_msg(message.grid)
    values = _values('source field', message.source, grid, np.float64).copy()
    if not np.isfinite(values).all():
        count = np.count_nonzero(~np.isfinite(values))
        raise InputError(f'source field: {count} cells are not finite; send a number for each')
    return values, grid


def rates_from_msg(messages: Iterable[Any]) -> dict[str, WellRate]:
    """Return the rates by well.

    Raises:
        InputError: a well occurs twice, a rate is not finite, or a concentration lies outside 0..1.
    """
    rates: dict[str, WellRate] = {}
    for message in messages:
        if message.well in rates:
            raise InputError(f"well '{message.well}' is named twice; name each once")
        try:
            # a node keeps the rates of a whole day: all of them share the names
            rates[sys.intern(message.well)] = WellRate(
                message.rate, message.concentration, getattr(message, 'rise', 0.0)
            )
        except InputError as error:
            raise InputError(f"well '{message.well}': {error}") from None
    return rates


def pumps_from_msg(messages: Iterable[Any]) -> dict[str, PumpFactor]:
    """Return the rate factors of the pumps by well.

    Raises:
        InputError: a number is not above 0, or a factor is as good as 0 or endless.
    """
    pumps = {one.well: PumpFactor(one.factor, one.deviation, one.metered) for one in messages}
    for well, pump in pumps.items():
        least, most = WRITTEN_ROUND_OFF, 1.0 / WRITTEN_ROUND_OFF
        factors = all(least <= number <= most for number in (pump.factor, pump.metered))
        if not (factors and 0.0 < pump.deviation <= most):
            raise InputError(
                f"pump of well '{well}': {tuple(pump)}; send a deviation above 0, and factors from "
                f'{least:g} to {most:g}'
            )
    return pumps


def plan_from_msg(messages: Iterable[Any]) -> tuple[RateStep, ...]:
    """Return the steps of a plan; `check_plan` checks their times.

    Raises:
        InputError: as `rates_from_msg`.
    """
    return tuple(
        RateStep(seconds_from_msg(step.start), rates_from_msg(step.wells)) for step in messages
    )


def cost_term_from_msg(message: Any, grid: Grid) -> CostTerm:
    """Return a cost term for maps on `grid`; `CostTerm.check` checks its times.

    Raises:
        InputError: a map has not one value for each cell.
    """

    def map_of(name: str) -> FloatArray | None:
        values = getattr(message, name)
        return _values(f'cost term, {name}:', values, grid, np.float64) if len(values) else None

    maps = {name: map_of(name) for name in ('linear', 'quadratic', 'target')}
    return CostTerm(seconds_from_msg(message.start), seconds_from_msg(message.end), **maps)


def _quantity_from_msg(message: Any) -> float | FloatArray:
    if len(message.values) == 0:
        return message.value
    return _values('quantity', message.values, grid_from_msg(message.grid), np.float64).copy()


def _named(names: Sequence[str], what: str, *columns: Sequence[Any]) -> Iterable[tuple[Any, ...]]:
    if any(len(column) != len(names) for column in columns):
        raise InputError(f'rig description: {what} has not one value for each name; send one')
    return zip(names, *columns, strict=True)


def _effect_from_msg(message: Any) -> dict[str, Any]:
    columns = (message.parameter_values, message.parameter_texts)
    named = _named(message.parameter_names, f"effect '{message.name}'", *columns)
    parameters: dict[str, Any] = {}
    for name, value, text in named:
        if name in parameters:
            raise InputError(f"effect '{message.name}': {name} is given twice; send it once")
        parameters[name] = text or value
    return {'name': message.name, 'parameters': parameters}


OFFER_STATES = ('offered', 'accepted', 'refused', 'taken back', 'expired')
"""States of an offer in words, by their numbers in `MendOffer`."""


def offer_state_from_msg(message: Any) -> tuple[str, bool]:
    """Return the state of a `MendOffer` in words, and whether it waits for an answer."""
    known = message.state < len(OFFER_STATES)
    state = OFFER_STATES[message.state] if known else 'unknown'
    return state, state == OFFER_STATES[0] and len(message.effects) > 0


def effects_from_msg(messages: Iterable[Any]) -> tuple[EffectDescription, ...]:
    """Return effects. The caller checks their names and parameters.

    Raises:
        InputError: a parameter has no value or is given twice, or a number is not finite.
    """
    found = [_effect_from_msg(message) for message in messages]
    for values in found:
        for name, value in values['parameters'].items():
            if not isinstance(value, str) and not math.isfinite(value):
                raise InputError(
                    f"effect '{values['name']}': {name} = {value}; send a finite number, or a text"
                )
    return tuple(EffectDescription(**values) for values in found)


def _pairs(values: Iterable[float], what: str) -> tuple[tuple[float, float], ...]:
    flat = [float(value) for value in values]
    if len(flat) % 2:
        raise InputError(f'rig description: {what} has {len(flat)} numbers; send pairs')
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def _camera_from_msg(message: Any) -> dict[str, Any]:
    names = message.curvature_names
    return {
        'corners_px': _pairs(message.corners, 'corners'),
        'colour_checker_px': _pairs(message.colour_checker, 'colour_checker') or None,
        'references_px': _places(message),
        'curvature': dict(_named(names, 'curvature', message.curvature_values)),
    }


def _places(message: Any) -> list[tuple[tuple[float, float], ...]]:
    """Return the reference places of a camera; bags recorded before they existed have none."""
    counts = [int(count) for count in getattr(message, 'reference_corners', ())]
    pixels = iter(_pairs(getattr(message, 'references', ()), 'references'))
    return [tuple(islice(pixels, count)) for count in counts]


def _objective_from_msg(message: Any) -> dict[str, Any]:
    # bags recorded before objectives could be chosen lack both fields
    name = getattr(message, 'objective', '') or ObjectiveDescription().name
    told = getattr(message, 'objective_parameters', '')
    if isinstance(told, str):
        return {**json_object(told), 'name': name}
    values = {}
    for one in told:
        if one.value.type not in VALUE_FIELDS:
            raise InputError(f"rig description: objective parameter '{one.name}' has no value")
        values[one.name] = getattr(one.value, VALUE_FIELDS[one.value.type])
    return {**nested(values), 'name': name}


def _optional(message: Any, field: str, to_lab: Callable[[float], float]) -> float | None:
    """Return a field of at most one number in the unit of rig.yaml; older bags have none."""
    return next((_rounded(to_lab(value)) for value in getattr(message, field, ())), None)


def _rate_prior(message: Any) -> tuple[float, ...] | None:
    return tuple(_rounded(to_ml_h(rate)) for rate in getattr(message, 'rate_prior', ())) or None


def _rounded(value: float) -> float:
    """Return `value` without the round-off of a change of units: 500.00000000000006 -> 500."""
    return float(f'{value:.14g}')


def _control_from_msg(message: Any) -> dict[str, Any]:
    fixed: dict[str, dict[str, Any]] = {
        name: {'rate_ml_h': _rounded(to_ml_h(well.rate)), 'concentration': well.concentration}
        for name, well in rates_from_msg(message.fixed).items()
    }
    for pause in getattr(message, 'pauses', ()):
        if pause.well not in fixed:
            raise InputError(f"rig description: a pause of '{pause.well}', which is not fixed")
        ends = (seconds_from_msg(end) / MINUTE_S for end in (pause.start, pause.end))
        fixed[pause.well].setdefault('pauses_min', []).append(tuple(map(_rounded, ends)))
    return {
        'wells': tuple(message.wells),
        'producer': message.producer or None,
        'fixed': fixed,
        'max_rate_ml_h': _rounded(to_ml_h(message.max_rate)),
        'max_total_rate_ml_h': _rounded(to_ml_h(message.max_total_rate)),
        'max_producer_rate_ml_h': _optional(message, 'max_producer_rate', to_ml_h),
        'stock_ml': _optional(message, 'stock', lambda volume: volume * ML),
        **_orders_from_msg(message),
        'disallowed_zone_m': _pairs(message.disallowed_zone, 'disallowed_zone'),
        'zone': ZONE_FILE if _has_zone(message) else None,
        'fuzziness_m': message.fuzziness,
        'objective': _objective_from_msg(message),
    }


def _has_zone(message: Any) -> bool:
    # bags recorded before a zone could be a picture lack the field
    return len(getattr(message, 'zone', ())) > 0


def _zone_from_msg(message: Any, rig: Rig) -> PictureZone:
    grid = grid_from_msg(message.zone_grid)
    if not grid.covers_the_same(rig.grid(1, 1)):
        raise InputError(f'rig description: zone lies on {grid}, not over the rig; send it again')
    shares = _values('zone', message.zone, grid, np.float32).astype(float)
    if not (np.isfinite(shares).all() and shares.min() >= 0.0 and shares.max() <= 1.0):
        raise InputError('rig description: zone must be shares from 0 to 1; send it again')
    return PictureZone(shares, grid)


def _orders_from_msg(message: Any) -> dict[str, Any]:
    """Return how rates are set; empty for a bag that was recorded before this could be said."""
    if not getattr(message, 'rate_step', 0.0):
        return {}
    max_change = _rounded(to_ml_h(message.max_change))
    return {
        'rate_step_ml_h': _rounded(to_ml_h(message.rate_step)),
        'min_rate_ml_h': _rounded(to_ml_h(message.min_rate)),
        'max_change_ml_h': max_change or None,
        'change_cost_ml_min': _rounded(to_ml_min(message.change_cost)),
        'end_min': _rounded(seconds_from_msg(message.end) / MINUTE_S) or None,
    }


def _water_from_msg(message: Any) -> dict[str, Any]:
    """Return the section of one water body."""
    ends, corners = list(message.ends), list(message.corners)
    place = (
        {'side': message.side, **dict(zip(('from_m', 'to_m'), ends, strict=False))}
        if message.side
        else {'corners_m': list(zip(corners[::2], corners[1::2], strict=False))}
    )
    return {
        **place,
        'head_m': next(iter(message.head), None),
        'rate_ml_h': _optional(message, 'rate', to_ml_h),
        'concentration': message.concentration,
        'diffuses': getattr(message, 'diffuses', False),
    }


def _levels_from_msg(message: Any) -> dict[str, Any]:
    """Return the section of the changing levels of one water."""
    minutes = [_rounded(time / MINUTE_S) for time in message.times]
    points = list(zip(minutes, message.heads, strict=False))
    return {'points': points, 'every_min': _rounded(message.period / MINUTE_S) or None}


def rig_from_msg(message: Any) -> Rig:
    """Return the rig of a message.

    Raises:
        InputError: a value is missing or wrong, or a map does not fit its grid.
    """
    sides: dict[str, Any] = {
        side: 'open' if getattr(message, f'open_{side}') else 'closed' for side in SIDES
    }
    if heads := getattr(message, 'heads', ()):  # older bags have none
        sides['heads_m'] = {head.side: head.head for head in heads}
    fringe = list(getattr(message, 'fringe', []))
    rig = rig_from_maps(
        {
            'name': message.name,
            'width_m': message.width,
            'height_m': message.height,
            'viscosity_pa_s': message.viscosity,
            'density_kg_m3': message.density,
            'boundaries': sides,
            'water': {body.name: _water_from_msg(body) for body in getattr(message, 'water', ())},
            'levels': {one.name: _levels_from_msg(one) for one in getattr(message, 'levels', ())},
            'water_table': {'fringe_m': fringe[0]} if fringe else None,
            'wells': {
                well.name: {
                    'x_m': well.x,
                    'z_m': well.z,
                    'radius_m': well.radius,
                    'rate_prior_ml_h': _rate_prior(well),
                }
                for well in message.wells
            },
            'camera': _camera_from_msg(message.camera[0]) if message.camera else None,
            'control': _control_from_msg(message.control[0]) if message.control else None,
            'effects': tuple(_effect_from_msg(effect) for effect in message.effects),
        },
        {
            'depth_m': _quantity_from_msg(message.depth),
            'porosity': _quantity_from_msg(message.porosity),
            'permeability_m2': _quantity_from_msg(message.permeability),
        },
    )
    if message.control and _has_zone(message.control[0]):
        return rig.with_zone(_zone_from_msg(message.control[0], rig))
    return rig
