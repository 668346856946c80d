"""The hub: takes one ready state after the other through the twin, and acts on fresh ones."""

import time
from collections.abc import Callable
from datetime import timedelta
from typing import Any

from porotwin_hub.forecast import ModelUnavailable
from porotwin_hub.freshness import PhotographClock
from porotwin_hub.inbox import ReadyState
from porotwin_hub.setpoint_expiry import SetpointDecision
from porotwin_hub.setpoint_limits import Limits
from porotwin_hub.twin import Cycle, Observation, Twin

ActuateFn = Callable[[SetpointDecision, ReadyState[Any]], None]
"""Commands the setpoint of a state; raises ModelUnavailable if the asset does not take it."""


class Hub:
    """Decides about ready states in their order; it holds the twin and the clock of photographs."""

    def __init__(
        self,
        twin: Twin,
        *,
        limits: Limits | None,
        photographs: PhotographClock | None,
        clock: Callable[[], float],
    ) -> None:
        """Make the hub.

        Args:
            twin: the loop.
            limits: of the wells, checked again before a setpoint leaves; None: no control.
            photographs: tells how late photographs are; None: in simulated time none is late.
            clock: returns the time [s] of arrivals; a clock that nobody sets.
        """
        self._twin = twin
        self._limits = limits
        self._photographs = photographs
        self._clock = clock

    def run(self, ready: ReadyState[Any], actuate: ActuateFn) -> Cycle:
        """Return the cycle of a ready state; a setpoint goes through `actuate` at once.

        A setpoint that the asset does not take is a remark of the cycle.

        Raises:
            RuntimeError: a setpoint breaks a limit; it was not commanded.
        """
        begin = time.perf_counter()
        if ready.time_went_back:
            self._twin.begin_anew()
        if ready.interruptions:
            self._twin.interrupt()
        late = self._lateness(ready)
        fresh = late <= self._twin.validity
        observation = Observation(ready.state.stamp, ready.state.concentration)
        cycle = self._twin.decide(observation, ready.known, actuate=fresh)
        cycle.durations['cycle'] = time.perf_counter() - begin
        if not fresh and self._limits is not None:
            age = timedelta(seconds=round(late))
            cycle.remarks.append(f'no setpoint: the photograph was taken {age} ago (h:mm:ss)')
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
            self._twin.reject_setpoint(cycle)
            cycle.remarks.append(str(error))

    def _lateness(self, ready: ReadyState[Any]) -> float:
        """Return the age of a photograph [s]; 0 in simulated time, which waits for the twin."""
        if self._photographs is None:
            return 0.0
        waited = self._clock() - ready.arrival
        return self._photographs.lateness(ready.state.stamp, ready.arrival) + waited
