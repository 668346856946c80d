"""Conversions between messages and the types of the algorithms; the only place that has both.

Every incoming message is checked here once: array sizes against grids, names, finite numbers.
"""

import array
import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid
from porotwin_core.rig import (
    Camera,
    Control,
    EffectDescription,
    ObjectiveDescription,
    Rig,
    rig_from_maps,
)
from porotwin_core.units import from_ml_h, to_ml_h
from porotwin_core.wells import WellRate, WellRates
from porotwin_msgs.msg import (
    CameraGeometry,
    ControlLimits,
    Effect,
    GridInfo,
    Outcome,
    Quantity,
    RigDescription,
    SourceField,
    TracerField,
)
from porotwin_msgs.msg import Well as WellMessage
from porotwin_msgs.msg import WellRate as WellRateMessage

RIG_FRAME = 'rig'
"""Frame of maps: origin at the lower left corner of the sand, x right, z up, y into the rig."""

CAMERA_FRAME = 'camera_optical'
"""Frame of photographs (REP-103): z forward, x right, y down."""


def time_to_msg(seconds: float) -> Time:
    """Return the stamp of a time [s], rounded to nanoseconds."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def time_from_msg(stamp: Time) -> float:
    """Return the time of a stamp [s], since the epoch of the clock that made it."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def header_at(seconds: float, frame: str = RIG_FRAME) -> Header:
    """Return a header with the stamp `seconds` [s]."""
    return Header(stamp=time_to_msg(seconds), frame_id=frame)


def grid_to_msg(grid: Grid) -> GridInfo:
    """Return the message of a grid."""
    return GridInfo(nx=grid.nx, nz=grid.nz, width=grid.width, height=grid.height)


def grid_from_msg(message: GridInfo) -> Grid:
    """Return the grid of a message.

    Raises:
        InputError: no cells, or a size that is not positive.
    """
    return Grid(message.nx, message.nz, message.width, message.height)


def _values(kind: str, values: array.array, grid: Grid, dtype: type) -> FloatArray:
    if len(values) != grid.nx * grid.nz:
        raise InputError(
            f'{kind} has {len(values)} values on a grid of {grid.nx} x {grid.nz}; '
            f'send {grid.nx * grid.nz}, row-major from the lower left'
        )
    return np.frombuffer(values, dtype=dtype).reshape(grid.shape)


def tracer_to_msg(concentration: FloatArray, grid: Grid, seconds: float) -> TracerField:
    """Return the message of a concentration map (nz, nx) [-] at `seconds` [s], as float32."""
    values = np.ascontiguousarray(concentration, dtype=np.float32)
    return TracerField(
        header=header_at(seconds),
        grid=grid_to_msg(grid),
        concentration=array.array('f', values.tobytes()),
    )


def tracer_from_msg(message: TracerField) -> tuple[FloatArray, Grid]:
    """Return the map (nz, nx) [-] in double precision, and its grid.

    Raises:
        InputError: the grid is wrong, or the number of values does not fit it.
    """
    grid = grid_from_msg(message.grid)
    values = _values('tracer field', message.concentration, grid, np.float32)
    return values.astype(np.float64), grid


def source_to_msg(source: FloatArray, grid: Grid, seconds: float) -> SourceField:
    """Return the message of a tracer source (nz, nx) [1/s] at `seconds` [s]."""
    values = np.ascontiguousarray(source, dtype=np.float64)
    return SourceField(
        header=header_at(seconds),
        grid=grid_to_msg(grid),
        source=array.array('d', values.tobytes()),
    )


def source_from_msg(message: SourceField) -> tuple[FloatArray, Grid]:
    """Return the tracer source (nz, nx) [1/s] and its grid.

    Raises:
        InputError: the grid is wrong, or the number of values does not fit it.
    """
    grid = grid_from_msg(message.grid)
    return _values('source field', message.source, grid, np.float64).copy(), grid


def rates_to_msg(rates: WellRates) -> list[WellRateMessage]:
    """Return one message for each rate, in the order of `rates`."""
    return [
        WellRateMessage(well=name, rate=well.rate, concentration=well.concentration)
        for name, well in rates.items()
    ]


def rates_from_msg(messages: Iterable[WellRateMessage]) -> dict[str, WellRate]:
    """Return the rates by well.

    Raises:
        InputError: a well occurs twice, a rate is not finite, or a concentration lies outside 0..1.
    """
    rates: dict[str, WellRate] = {}
    for message in messages:
        if message.well in rates:
            raise InputError(f"well '{message.well}' is named twice; name each once")
        try:
            rates[message.well] = WellRate(message.rate, message.concentration)
        except InputError as error:
            raise InputError(f"well '{message.well}': {error}") from None
    return rates


def ok() -> Outcome:
    """Return the outcome of a successful request."""
    return Outcome(code=Outcome.OK)


def refusal(error: Exception) -> Outcome:
    """Return the outcome of a request that raised `error`, with its message on one line."""
    code = Outcome.INVALID_INPUT if isinstance(error, InputError) else Outcome.FAILED
    text = ' '.join(str(error).split())
    return Outcome(code=code, message=text or type(error).__name__)


def _quantity_to_msg(value: float | FloatArray, rig: Rig) -> Quantity:
    if isinstance(value, float):
        return Quantity(value=value)
    grid = rig.grid(value.shape[1], value.shape[0])
    return Quantity(
        value=math.nan,
        grid=grid_to_msg(grid),
        values=array.array('d', np.ascontiguousarray(value, dtype=np.float64).tobytes()),
    )


def _quantity_from_msg(message: Quantity) -> float | FloatArray:
    if len(message.values) == 0:
        return message.value
    return _values('quantity', message.values, grid_from_msg(message.grid), np.float64).copy()


def effect_to_msg(effect: EffectDescription) -> Effect:
    """Return the message of an effect; NaN stands for a number where the value is a text."""
    message = Effect(name=effect.name)
    for name, value in effect.parameters.items():
        text = isinstance(value, str)
        message.parameter_names.append(name)
        message.parameter_values.append(math.nan if text else value)
        message.parameter_texts.append(value if text else '')
    return message


def _named(names: Sequence[str], what: str, *columns: Sequence[Any]) -> Iterable[tuple[Any, ...]]:
    if any(len(column) != len(names) for column in columns):
        raise InputError(f'rig description: {what} has not one value for each name; send one')
    return zip(names, *columns, strict=True)


def _effect_from_msg(message: Effect) -> dict[str, Any]:
    columns = (message.parameter_values, message.parameter_texts)
    named = _named(message.parameter_names, f"effect '{message.name}'", *columns)
    parameters = {name: text or value for name, value, text in named}
    return {'name': message.name, 'parameters': parameters}


def _camera_to_msg(camera: Camera) -> CameraGeometry:
    checker = camera.colour_checker_px or ()
    return CameraGeometry(
        corners=[value for corner in camera.corners_px for value in corner],
        colour_checker=[value for corner in checker for value in corner],
        curvature_names=list(camera.curvature),
        curvature_values=list(camera.curvature.values()),
    )


def _pairs(values: Iterable[float], what: str) -> tuple[tuple[float, float], ...]:
    flat = [float(value) for value in values]
    if len(flat) % 2:
        raise InputError(f'rig description: {what} has {len(flat)} numbers; send pairs')
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def _camera_from_msg(message: CameraGeometry) -> dict[str, Any]:
    names = message.curvature_names
    return {
        'corners_px': _pairs(message.corners, 'corners'),
        'colour_checker_px': _pairs(message.colour_checker, 'colour_checker') or None,
        'curvature': dict(_named(names, 'curvature', message.curvature_values)),
    }


def _objective_from_msg(message: ControlLimits) -> dict[str, Any]:
    # bags recorded before objectives could be chosen lack both fields
    name = getattr(message, 'objective', '') or ObjectiveDescription().name
    text = getattr(message, 'objective_parameters', '') or '{}'
    try:
        parameters = json.loads(text)
    except ValueError:
        parameters = None
    if not isinstance(parameters, dict):
        raise InputError(
            f"rig description: objective_parameters '{text}': send a JSON object, or nothing"
        )
    return {**parameters, 'name': name}


def _control_to_msg(control: Control) -> ControlLimits:
    fixed = {
        name: WellRate(from_ml_h(well.rate_ml_h), well.concentration)
        for name, well in control.fixed.items()
    }
    return ControlLimits(
        wells=list(control.wells),
        producer=control.producer or '',
        fixed=rates_to_msg(fixed),
        max_rate=from_ml_h(control.max_rate_ml_h),
        max_total_rate=from_ml_h(control.max_total_rate_ml_h),
        disallowed_zone=[value for point in control.disallowed_zone_m for value in point],
        fuzziness=control.fuzziness_m,
        objective=control.objective.name,
        objective_parameters=(
            json.dumps(control.objective.parameters) if control.objective.parameters else ''
        ),
    )


def _rounded(value: float) -> float:
    """Return `value` without the round-off of a change of units: 500.00000000000006 -> 500."""
    return float(f'{value:.14g}')


def _control_from_msg(message: ControlLimits) -> dict[str, Any]:
    fixed = {
        name: {'rate_ml_h': _rounded(to_ml_h(well.rate)), 'concentration': well.concentration}
        for name, well in rates_from_msg(message.fixed).items()
    }
    return {
        'wells': tuple(message.wells),
        'producer': message.producer or None,
        'fixed': fixed,
        'max_rate_ml_h': _rounded(to_ml_h(message.max_rate)),
        'max_total_rate_ml_h': _rounded(to_ml_h(message.max_total_rate)),
        'disallowed_zone_m': _pairs(message.disallowed_zone, 'disallowed_zone'),
        'fuzziness_m': message.fuzziness,
        'objective': _objective_from_msg(message),
    }


def rig_to_msg(rig: Rig) -> RigDescription:
    """Return the message of a rig with its maps."""
    return RigDescription(
        name=rig.name,
        width=rig.width_m,
        height=rig.height_m,
        depth=_quantity_to_msg(rig.nominal_map('depth_m'), rig),
        porosity=_quantity_to_msg(rig.nominal_map('porosity'), rig),
        permeability=_quantity_to_msg(rig.nominal_map('permeability_m2'), rig),
        viscosity=rig.viscosity_pa_s,
        density=rig.density_kg_m3,
        open_top=rig.boundaries.top == 'open',
        open_bottom=rig.boundaries.bottom == 'open',
        open_left=rig.boundaries.left == 'open',
        open_right=rig.boundaries.right == 'open',
        wells=[
            WellMessage(name=name, x=well.x_m, z=well.z_m, radius=well.radius_m)
            for name, well in rig.wells.items()
        ],
        camera=[_camera_to_msg(rig.camera)] if rig.camera else [],
        control=[_control_to_msg(rig.control)] if rig.control else [],
        effects=[effect_to_msg(effect) for effect in rig.effects],
    )


def rig_from_msg(message: RigDescription) -> Rig:
    """Return the rig of a message.

    Raises:
        InputError: a value is missing or wrong, or a map does not fit its grid.
    """
    sides = {
        side: 'open' if getattr(message, f'open_{side}') else 'closed'
        for side in ('top', 'bottom', 'left', 'right')
    }
    return rig_from_maps(
        {
            'name': message.name,
            'width_m': message.width,
            'height_m': message.height,
            'viscosity_pa_s': message.viscosity,
            'density_kg_m3': message.density,
            'boundaries': sides,
            'wells': {
                well.name: {'x_m': well.x, 'z_m': well.z, 'radius_m': well.radius}
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
