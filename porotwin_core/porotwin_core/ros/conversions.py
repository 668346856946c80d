"""Conversions between messages and the types of the algorithms, in both directions.

The functions `..._from_msg` come from `from_messages`, which needs no ROS. Every number of a float
field is made a float here: a message would send an int as another number.
"""

import array
import math
from collections.abc import Callable, Iterable, Mapping, MutableSequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter, ParameterValue
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.units import MINUTE_S, ML, from_ml_h, from_ml_min
from porotwin_core.geometry.grid import FloatArray, Grid
from porotwin_core.geometry.zone_shapes import PictureZone
from porotwin_core.model.cost_term import CostTerm
from porotwin_core.model.learnt_physics import LearntPhysics
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.wells import RateStep, WellRate, WellRates
from porotwin_core.rig import (
    Camera,
    Control,
    EffectDescription,
    Rig,
    WaterBody,
)
from porotwin_core.ros.from_messages import RIG_FRAME as RIG_FRAME
from porotwin_core.ros.from_messages import cost_term_from_msg as cost_term_from_msg
from porotwin_core.ros.from_messages import deviation_from_msg as deviation_from_msg
from porotwin_core.ros.from_messages import effects_from_msg as effects_from_msg
from porotwin_core.ros.from_messages import grid_from_msg as grid_from_msg
from porotwin_core.ros.from_messages import nanoseconds_from_msg as nanoseconds_from_msg
from porotwin_core.ros.from_messages import offer_state_from_msg as offer_state_from_msg
from porotwin_core.ros.from_messages import plan_from_msg as plan_from_msg
from porotwin_core.ros.from_messages import pumps_from_msg as pumps_from_msg
from porotwin_core.ros.from_messages import rates_from_msg as rates_from_msg
from porotwin_core.ros.from_messages import rig_from_msg as rig_from_msg
from porotwin_core.ros.from_messages import seconds_from_msg as seconds_from_msg
from porotwin_core.ros.from_messages import source_from_msg as source_from_msg
from porotwin_core.ros.from_messages import time_from_msg as time_from_msg
from porotwin_core.ros.from_messages import tracer_from_msg as tracer_from_msg
from porotwin_core.ros.nested_parameters import VALUE_FIELDS, flattened
from porotwin_msgs.msg import (
    CameraGeometry,
    ControlLimits,
    Effect,
    GridInfo,
    Outcome,
    Pause,
    Quantity,
    RateFactor,
    RigDescription,
    SideHead,
    SourceField,
    TracerField,
    WaterLevels,
)
from porotwin_msgs.msg import CostTerm as CostTermMessage
from porotwin_msgs.msg import RateStep as RateStepMessage
from porotwin_msgs.msg import WaterBody as WaterMessage
from porotwin_msgs.msg import Well as WellMessage
from porotwin_msgs.msg import WellRate as WellRateMessage

CAMERA_FRAME = 'camera_optical'
"""Frame of photographs (REP-103): z forward, x right, y down."""


def time_to_msg(seconds: float) -> Time:
    """Return the stamp of a time [s], rounded to nanoseconds."""
    return stamp_to_msg(round(seconds * 1e9))


def stamp_to_msg(nanoseconds: int) -> Time:
    """Return the stamp of a time [ns], exactly."""
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def duration_to_msg(seconds: float) -> Duration:
    """Return the message of a span of time [s], rounded to nanoseconds.

    Raises:
        InputError: a message holds no such span.
    """
    if not abs(seconds) <= np.iinfo(np.int32).max:
        raise InputError(f'a time of {seconds:g} s fits no message; give at most a few years')
    stamp = time_to_msg(seconds)
    return Duration(sec=stamp.sec, nanosec=stamp.nanosec)


def header_at(seconds: float, frame: str = RIG_FRAME) -> Header:
    """Return a header with the stamp `seconds` [s]."""
    return Header(stamp=time_to_msg(seconds), frame_id=frame)


def grid_to_msg(grid: Grid) -> GridInfo:
    """Return the message of a grid."""
    return GridInfo(nx=grid.nx, nz=grid.nz, width=float(grid.width), height=float(grid.height))


def tracer_to_msg(concentration: FloatArray, grid: Grid, seconds: float) -> TracerField:
    """Return the message of a concentration map (nz, nx) [-] at `seconds` [s], as float32."""
    return TracerField(
        header=header_at(seconds),
        grid=grid_to_msg(grid),
        concentration=map_to_msg(concentration),
    )


def map_to_msg(values: FloatArray | None) -> MutableSequence[float]:
    """Return the float32 field of a message for a map (nz, nx); empty for None (unknown)."""
    if values is None:
        return array.array('f')
    return array.array('f', np.ascontiguousarray(values, dtype=np.float32).tobytes())


def image_to_msg(pixels: NDArray[Any], header: Header) -> Image:
    """Return pixels as the image that every viewer of ROS draws; NaN stays NaN.

    Args:
        pixels: numbers (rows, columns), or colours (rows, columns, 3), blue-green-red of 8 bits;
            the top row first.
        header: of the map that they show.
    """
    coloured = pixels.ndim == 3
    data = np.ascontiguousarray(pixels, np.uint8 if coloured else '<f4')
    return Image(
        header=header,
        height=data.shape[0],
        width=data.shape[1],
        encoding='bgr8' if coloured else '32FC1',
        step=data.strides[0],
        data=array.array('B', data.tobytes()),
    )


def source_to_msg(source: FloatArray, grid: Grid, seconds: float) -> SourceField:
    """Return the message of a tracer source (nz, nx) [1/s] at `seconds` [s]."""
    values = np.ascontiguousarray(source, dtype=np.float64)
    return SourceField(
        header=header_at(seconds),
        grid=grid_to_msg(grid),
        source=array.array('d', values.tobytes()),
    )


def rates_to_msg(rates: WellRates) -> list[WellRateMessage]:
    """Return one message for each rate, in the order of `rates`."""
    return [
        WellRateMessage(
            well=name,
            rate=float(well.rate),
            concentration=float(well.concentration),
            rise=float(well.rise),
        )
        for name, well in rates.items()
    ]


def pumps_to_msg(pumps: Mapping[str, PumpFactor]) -> list[RateFactor]:
    """Return the rate factors of the pumps."""
    return [RateFactor(well=well, **pump._asdict()) for well, pump in pumps.items()]


def plan_to_msg(plan: Iterable[RateStep]) -> list[RateStepMessage]:
    """Return one message for each step of a plan."""
    return [
        RateStepMessage(start=duration_to_msg(step.start), wells=rates_to_msg(step.rates))
        for step in plan
    ]


def cost_term_to_msg(term: CostTerm) -> CostTermMessage:
    """Return the message of a cost term."""

    def flat(values: FloatArray | None) -> MutableSequence[float]:
        if values is None:
            return array.array('d')
        return array.array('d', np.ascontiguousarray(values, dtype=np.float64).tobytes())

    return CostTermMessage(
        start=duration_to_msg(term.start),
        end=duration_to_msg(term.end),
        linear=flat(term.linear),
        quadratic=flat(term.quadratic),
        target=flat(term.target),
    )


def learnt_to_msg(learnt: LearntPhysics) -> list[Effect]:
    """Return the effects of learnt physics as messages."""
    return [effect_to_msg(effect) for effect in learnt.effects]


def ok(note: str = '') -> Outcome:
    """Return the outcome of a successful request, with a `note` on its answer in one line."""
    return Outcome(code=Outcome.OK, message=note)


def refusal(error: Exception) -> Outcome:
    """Return the outcome of a request that raised `error`, with the message in one line."""
    code = Outcome.INVALID_INPUT if isinstance(error, InputError) else Outcome.FAILED
    text = ' '.join(str(error).split())
    return Outcome(code=code, message=text or type(error).__name__)


def _quantity_to_msg(value: float | FloatArray, rig: Rig) -> Quantity:
    if isinstance(value, int | float):
        return Quantity(value=float(value))
    grid = rig.grid(value.shape[1], value.shape[0])
    return Quantity(
        value=math.nan,
        grid=grid_to_msg(grid),
        values=array.array('d', np.ascontiguousarray(value, dtype=np.float64).tobytes()),
    )


def effect_to_msg(effect: EffectDescription) -> Effect:
    """Return the message of an effect; a text value has NaN as its number."""
    message = Effect(name=effect.name)
    for name, value in effect.parameters.items():
        text = isinstance(value, str)
        message.parameter_names.append(name)
        message.parameter_values.append(math.nan if text else float(value))
        message.parameter_texts.append(value if text else '')
    return message


def _camera_to_msg(camera: Camera) -> CameraGeometry:
    checker = camera.colour_checker_px or ()
    return CameraGeometry(
        corners=[value for corner in camera.corners_px for value in corner],
        colour_checker=[value for corner in checker for value in corner],
        references=[value for place in camera.references_px for pixel in place for value in pixel],
        reference_corners=[len(place) for place in camera.references_px],
        curvature_names=list(camera.curvature),
        curvature_values=list(camera.curvature.values()),
    )


def _control_to_msg(control: Control, zone: PictureZone | None) -> ControlLimits:
    fixed = {
        name: WellRate(from_ml_h(well.rate_ml_h), well.concentration)
        for name, well in control.fixed.items()
    }
    message = ControlLimits(
        wells=list(control.wells),
        producer=control.producer or '',
        fixed=rates_to_msg(fixed),
        max_rate=from_ml_h(control.max_rate_ml_h),
        pauses=[
            Pause(
                well=name,
                start=duration_to_msg(MINUTE_S * start),
                end=duration_to_msg(MINUTE_S * end),
            )
            for name, well in control.fixed.items()
            for start, end in well.pauses_min
        ],
        max_total_rate=from_ml_h(control.max_total_rate_ml_h),
        max_producer_rate=_optional(control.max_producer_rate_ml_h, from_ml_h),
        stock=[] if control.stock_ml is None else [control.stock_ml / ML],
        rate_step=from_ml_h(control.rate_step_ml_h),
        min_rate=from_ml_h(control.min_rate_ml_h),
        max_change=from_ml_h(control.max_change_ml_h or 0.0),
        change_cost=from_ml_min(control.change_cost_ml_min),
        end=duration_to_msg(MINUTE_S * (control.end_min or 0.0)),
        disallowed_zone=[value for point in control.disallowed_zone_m for value in point],
        fuzziness=control.fuzziness_m,
        objective=control.objective.name,
        objective_parameters=[
            Parameter(name=name, value=ParameterValue(type=kind, **{VALUE_FIELDS[kind]: value}))
            for name, kind, value in flattened(control.objective.parameters)
        ],
    )
    if zone is not None:
        message.zone_grid = grid_to_msg(zone.raster)
        message.zone = array.array('f', np.ascontiguousarray(zone.shares, np.float32).tobytes())
    return message


def _optional(value: float | None, to_si: Callable[[float], float]) -> list[float]:
    return [] if value is None else [to_si(value)]


def _water_to_msg(name: str, body: WaterBody) -> WaterMessage:
    ends = [body.from_m] if body.to_m is None else [body.from_m, body.to_m]
    return WaterMessage(
        name=name,
        side=body.side or '',
        ends=ends if body.side else [],
        corners=[value for corner in body.corners_m or () for value in corner],
        head=[] if body.head_m is None else [body.head_m],
        rate=_optional(body.rate_ml_h, from_ml_h),
        concentration=body.concentration,
        diffuses=body.diffuses,
    )


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
        heads=[
            SideHead(side=side, head=head) for side, head in (rig.boundaries.heads_m or {}).items()
        ],
        water=[_water_to_msg(name, body) for name, body in rig.water.items()],
        levels=[
            WaterLevels(
                name=name,
                times=[MINUTE_S * minute for minute, _ in course.points],
                heads=[head for _, head in course.points],
                period=MINUTE_S * (course.every_min or 0.0),
            )
            for name, course in rig.levels.items()
        ],
        fringe=[rig.water_table.fringe_m] if rig.water_table else [],
        wells=[
            WellMessage(
                name=name,
                x=well.x_m,
                z=well.z_m,
                radius=well.radius_m,
                rate_prior=[from_ml_h(rate) for rate in well.rate_prior_ml_h or ()],
            )
            for name, well in rig.wells.items()
        ],
        camera=[_camera_to_msg(rig.camera)] if rig.camera else [],
        control=[_control_to_msg(rig.control, rig.zone)] if rig.control else [],
        effects=[effect_to_msg(effect) for effect in rig.effects],
    )
