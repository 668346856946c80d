"""The hub: takes one ready state after the other through the twin, and acts on fresh ones."""

import math
import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

from porotwin_hub.control.setpoint_limits import Limits
from porotwin_hub.loop.cycle import Cycle, Observation
from porotwin_hub.loop.inbox import ReadyState
from porotwin_hub.loop.twin import Twin
from porotwin_hub.models.forecast import ModelUnavailable
from porotwin_hub.operator.announcement import NO_SETPOINT
from porotwin_hub.operator.setpoint_expiry import SetpointDecision

ActuateFn = Callable[[SetpointDecision, ReadyState[Any]], None]
"""Commands the setpoint of a state; raises ModelUnavailable if the asset does not take it."""


class Hub:
    """Decides about ready states in their order; it holds the twin."""

    def __init__(
        self,
        twin: Twin,
        *,
        limits: Limits | None,
        clock: Callable[[], float],
        most_age: float = math.inf,
    ) -> None:
        """Make the hub.

        Args:
            twin: the loop.
            limits: of the wells, checked again before a setpoint leaves; None: no control.
            clock: returns the time [s] of arrivals; a clock that nobody sets.
            most_age: age [s] up to which a photograph is acted on; in simulated time none is late.
        """
        self._twin = twin
        self._limits = limits
        self._clock = clock
        self._most_age = most_age

    def run(self, ready: ReadyState[Any], actuate: ActuateFn, *, objection: str = '') -> Cycle:
        """Return the cycle of a ready state; a setpoint goes through `actuate` at once.

        A setpoint that the asset does not take is a remark of the cycle. A state whose stamp is not
        believed changes nothing: its cycle holds a remark only.

        Args:
            ready: the state.
            actuate: commands a setpoint.
            objection: why no setpoint may follow now; empty: it may.

        Raises:
            RuntimeError: a setpoint breaks a limit; it was not commanded.
        """
        begin = time.perf_counter()
        state = ready.state
        observation = Observation(
            state.stamp, state.concentration, state.deviation, state.systematic
        )
        if not ready.is_believed:
            cycle = self._twin.set_aside(observation)
            cycle.remarks += ready.doubts
            cycle.durations['cycle'] = time.perf_counter() - begin
            return cycle
        if ready.time_went_back:
            self._twin.begin_anew()
        if ready.interruptions:
            self._twin.interrupt()
        objection = self._lateness(ready) or objection
        cycle = self._twin.decide(observation, ready.known, actuate=not objection)
        cycle.durations['cycle'] = time.perf_counter() - begin
        cycle.remarks += ready.doubts
        if objection and self._twin.controls:
            cycle.remarks.append(f'{NO_SETPOINT}{objection}')
        if cycle.setpoint is not None:
            self._actuate(cycle, ready, actuate)
        self._twin.look_ahead(cycle)
        if cycle.setpoint is None:
            cycle.durations['cycle'] = time.perf_counter() - begin
        if ready.skipped:
            cycle.remarks.append(
                f'{ready.skipped} older states skipped: cycles are slower than photos'
            )
        return cycle

    def _actuate(self, cycle: Cycle, ready: ReadyState[Any], actuate: ActuateFn) -> None:
        assert cycle.setpoint is not None
        rates = cycle.setpoint.rates
        broken = self._limits.violations(rates) if self._limits is not None else []
        if broken:
            raise RuntimeError(f'setpoint withheld: {"; ".join(broken)}')
        try:
            actuate(cycle.setpoint, ready)
        except ModelUnavailable as error:
            self._twin.choice.reject(cycle)
            cycle.remarks.append(str(error))
        except Exception:
            self._twin.choice.reject(cycle)
            raise

    def _lateness(self, ready: ReadyState[Any]) -> str:
        """Return that a photograph is too late to act on, in words, or an empty string."""
        age = ready.judgement.age + self._clock() - ready.arrival
        if age <= self._most_age:
            return ''
        return f'the photograph was taken {timedelta(seconds=round(age))} ago (h:mm:ss)'
