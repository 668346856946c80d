"""The report of a cycle as a message."""

import math

from porotwin_core.ros.conversions import duration_to_msg, pumps_to_msg
from porotwin_hub.loop.cycle import Cycle
from porotwin_msgs.msg import CycleReport, NewState


def report_of(cycle: Cycle, state: NewState) -> CycleReport:
    """Return the report of a cycle that began with the message `state`."""
    decision, forecast = cycle.decision, cycle.forecast
    durations = {
        f'{part}_duration': duration_to_msg(cycle.durations.get(part, 0.0))
        for part in ('predict', 'correct', 'optimise', 'cycle')
    }
    return CycleReport(
        header=state.header,
        sequence=state.sequence,
        prediction_error=cycle.prediction_error,
        corrected_error=cycle.corrected_error,
        expected_error=cycle.expected_error,
        disallowed_tracer=cycle.disallowed_tracer,
        objective_unchanged=decision.cost_unchanged if decision else math.nan,
        objective=decision.cost if decision else math.nan,
        objective_evaluations=decision.evaluations if decision else 0,
        corrected=forecast is not None and forecast.is_corrected,
        correction_status=forecast.correction_status if forecast else 'no forecast',
        **durations,
        rate_factors=pumps_to_msg(cycle.rate_factors),
        remarks=[*cycle.remarks, *cycle.notes],
    )
