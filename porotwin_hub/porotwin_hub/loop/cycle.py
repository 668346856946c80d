"""One turn of the loop: the observation that it begins with, and all that follows from it."""

import math
from dataclasses import dataclass, field

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.state_filter import Seen
from porotwin_core.rates.delivered_rates import PumpFactor
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.optimisation import Decision
from porotwin_hub.models.forecast import Forecast
from porotwin_hub.operator.setpoint_expiry import SetpointDecision


@dataclass(frozen=True)
class Observation:
    """An observed state: concentration (nz, nx) [-] at `time` [s]; NaN where nothing was seen.

    `deviation` is its standard deviation, and `systematic` the part of it that stays the same from
    photograph to photograph, both (nz, nx) [-]; None: not known.
    """

    time: float
    concentration: FloatArray
    deviation: FloatArray | None = None
    systematic: FloatArray | None = None


@dataclass
class Cycle:
    """The results of one observation.

    Attributes:
        observation: the state that the asset emitted.
        state: the state estimate, (nz, nx) [-]; without a filter the observation with its unseen
            cells filled in.
        seen: the observation with its errors; None: they are not used.
        observed: the observation, with a filter without the error of its scale, (nz, nx) [-].
        periods: the rates in force [m^3/s] since the last observation; empty: there was none, or
            no model.
        pumped: the rates in force when the observation was made.
        prediction_error: relative error [-] of the prediction made for the observation; NaN: none.
        corrected_error: the same for the corrected prediction.
        expected_error: the same that the deviations of map and forecast lead one to expect.
        disallowed_tracer: observed tracer where the objective does not allow it [m^3].
        setpoint: the rates to command; None: none follows from this observation.
        accepted: whether the asset took the setpoint.
        decision: the result of the optimiser, if it ran.
        elapsed: the forecast of the observation that is judged; None: none could be made.
        forecast: the forecast of the next observation; None: none could be made.
        rate_factors: delivered over commanded rate, by well.
        durations: wall-clock times [s] of 'optimise', 'predict' and 'correct'.
        remarks: faults of the cycle, one line each.
        notes: lines for people that are no faults.
    """

    observation: Observation
    state: FloatArray
    periods: tuple[RatePeriod, ...]
    pumped: WellRates
    prediction_error: float = math.nan
    corrected_error: float = math.nan
    expected_error: float = math.nan
    disallowed_tracer: float = math.nan
    setpoint: SetpointDecision | None = None
    accepted: bool = True
    decision: Decision | None = None
    elapsed: Forecast | None = None
    forecast: Forecast | None = None
    rate_factors: dict[str, PumpFactor] = field(default_factory=dict)
    seen: Seen | None = None
    durations: dict[str, float] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.observed = self.observation.concentration
