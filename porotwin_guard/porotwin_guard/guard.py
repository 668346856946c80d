"""The last check of a setpoint before it reaches the pumps, independent of the hub.

The guard reads rig.yaml by itself and shares no code with the hub's limits. So it also finds faults
of the hub's limits.
"""

import math
from dataclasses import dataclass

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import to_ml_h
from porotwin_core.clock.stamps import SAME_STAMP_S
from porotwin_core.rates.rate_periods import ROUND_OFF_ML_H
from porotwin_core.rates.wells import WellRates, net_rate_words
from porotwin_core.rig import Rig
from porotwin_guard.camera_lag import CameraLag

VALIDITY_INTERVALS = 3
"""Photo intervals that a setpoint may be valid (docs/formats.md). The hub has a number of its own:
the guard judges it."""


@dataclass(frozen=True)
class SetpointRequest:
    """A setpoint of a hub: times in [s], rates of all wells [m^3/s].

    `hub` identifies the sending process; a restarted hub has another identity.
    """

    sequence: int
    stamp: float
    valid_until: float
    rates: WellRates
    hub: str


class Guard:
    """Passes setpoints that keep all rules, and remembers the last one."""

    def __init__(self, rig: Rig, *, photo_interval: float) -> None:
        """Read the limits of `rig`; photographs come every `photo_interval` [s]."""
        self._interval = photo_interval
        self._lag = CameraLag(photo_interval)
        self._wells = frozenset(rig.wells)
        self._balanced = rig.control is not None and rig.control.producer is not None
        self._total_ml_h = rig.control.max_total_rate_ml_h if rig.control else 0.0
        self._control_wells = rig.control.wells if rig.control else ()
        self._ranges_ml_h = _ranges_ml_h(rig)
        self._pausing = frozenset(
            name
            for name, well in (rig.control.fixed if rig.control else {}).items()
            if well.pauses_min
        )
        self._step_ml_h = rig.control.rate_step_ml_h if rig.control else 0.0
        self._least_ml_h = rig.control.min_rate_ml_h if rig.control else 0.0
        self._change_ml_h = (rig.control and rig.control.max_change_ml_h) or math.inf
        self._fluids = {
            name: well.concentration
            for name, well in (rig.control.fixed if rig.control else {}).items()
        }
        self._last: SetpointRequest | None = None
        self._passed = -math.inf

    def check(self, request: SetpointRequest, *, now: float) -> None:
        """Check that the pumps may run `request` from `now` [s] on, on the clock of its stamps.

        `take` tells that they do.

        Raises:
            InputError: a rule is broken; one line with the well or the time.
        """
        self._check_rates(request.rates)
        self._check_settings(request.rates, now)
        self._check_times(request, now)
        self._check_order(request, now)

    def take(self, request: SetpointRequest, *, now: float) -> None:
        """Note that the pumps run a checked `request` from `now` [s] on."""
        self._last, self._passed = request, now

    def expired(self, now: float) -> int | None:
        """Return the number of the last setpoint if it has expired at `now` [s], else None."""
        return self._last.sequence if self._last and not self._in_force(now) else None

    def _check_rates(self, rates: WellRates) -> None:
        if set(rates) != self._wells:
            odd = ', '.join(sorted(self._wells ^ set(rates)))
            raise InputError(f'it must name every well of rig.yaml and no other; see {odd}')
        for name, (low, high) in self._ranges_ml_h.items():
            well, rate_ml_h = rates[name], to_ml_h(rates[name].rate)
            if name in self._pausing and abs(rate_ml_h) <= ROUND_OFF_ML_H:
                continue  # the guard does not know when the experiment began
            if not low - ROUND_OFF_ML_H <= rate_ml_h <= high + ROUND_OFF_ML_H:
                raise InputError(
                    f"well '{name}': {rate_ml_h:g} ml/h; rig.yaml allows {low:g} to {high:g} ml/h"
                )
            fluid = self._fluids.get(name, 0.0)
            if well.rate > 0.0 and not abs(well.concentration - fluid) <= WRITTEN_ROUND_OFF:
                raise InputError(
                    f"well '{name}' injects concentration {well.concentration:g}, must be {fluid:g}"
                )
        total = math.fsum(to_ml_h(rates[name].rate) for name in self._control_wells)
        if not total <= self._total_ml_h + ROUND_OFF_ML_H:
            raise InputError(
                f'control wells inject {total:g} ml/h; rig.yaml allows {self._total_ml_h:g} ml/h'
            )
        net = math.fsum(well.rate for well in rates.values())
        if self._balanced and not abs(to_ml_h(net)) <= ROUND_OFF_ML_H:
            raise InputError(f'{net_rate_words(net)}; with a producer the sum must be zero')

    def _check_settings(self, rates: WellRates, now: float) -> None:
        """Check that the pumps can change to `rates` from the rates in force at `now` [s].

        After a setpoint has expired these are the safe rates, where control wells rest. A guard
        that has just started does not know them. All control wells may always be switched off.

        Raises:
            InputError: a rate is off the steps of the pump, too small, or too far from the last.
        """
        wanted = {name: to_ml_h(rates[name].rate) for name in self._control_wells}
        for name, rate_ml_h in wanted.items():
            told = f"well '{name}': {rate_ml_h:g} ml/h"
            if abs(math.remainder(rate_ml_h, self._step_ml_h)) > ROUND_OFF_ML_H:
                raise InputError(f'{told}; rig.yaml allows multiples of {self._step_ml_h:g} ml/h')
            if ROUND_OFF_ML_H < rate_ml_h < self._least_ml_h - ROUND_OFF_ML_H:
                raise InputError(f'{told}; rig.yaml allows none below {self._least_ml_h:g} ml/h')
            if self._last is None or not any(wanted.values()):
                continue
            before_ml_h = to_ml_h(self._last.rates[name].rate) if self._in_force(now) else 0.0
            change = abs(rate_ml_h - before_ml_h)
            if change > self._change_ml_h + ROUND_OFF_ML_H:
                raise InputError(
                    f'{told} changes by {change:g} ml/h; rig.yaml allows {self._change_ml_h:g} ml/h'
                )

    def _check_times(self, request: SetpointRequest, now: float) -> None:
        validity = request.valid_until - request.stamp
        longest = VALIDITY_INTERVALS * self._interval
        if not 0.0 < validity <= longest + SAME_STAMP_S:
            raise InputError(
                f'it is valid for {validity:g} s; the guard allows up to {longest:g} s'
            )
        age = self._lag.age(request.stamp, now)
        if -self._interval <= age <= validity:  # clocks may differ by an interval
            self._lag.agrees()
        elif not self._lag.learns(request.stamp, now):
            if age > 0.0:
                raise InputError(f'it expired {age - validity:.1f} s ago')
            raise InputError(f'its photograph lies {-age:.1f} s in the future')

    def _check_order(self, request: SetpointRequest, now: float) -> None:
        last = self._last
        if last is None:
            return
        if request.hub == last.hub and request.sequence <= last.sequence:
            raise InputError(f'its number does not follow {last.sequence}')
        if request.stamp <= last.stamp and self._in_force(now):
            raise InputError(
                f'its photograph is no newer than the one of setpoint {last.sequence}, '
                'which is in force'
            )

    def _in_force(self, now: float) -> bool:
        """Return whether the last setpoint holds at `now` [s]; a clock set back ends it."""
        if self._last is None:
            return False
        validity = self._last.valid_until - self._last.stamp
        return self._passed <= now <= self._passed + validity


def _ranges_ml_h(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the least and the greatest rate of every well [ml/h]; wells without a role are off."""
    control = rig.control
    if control is None:
        return dict.fromkeys(rig.wells, (0.0, 0.0))
    ranges = dict.fromkeys(control.wells, (0.0, control.max_rate_ml_h))
    ranges |= {name: (well.rate_ml_h, well.rate_ml_h) for name, well in control.fixed.items()}
    if control.producer is not None:
        ranges[control.producer] = (-control.most_taken_ml_h, 0.0)
    return ranges | dict.fromkeys(rig.wells.keys() - ranges.keys(), (0.0, 0.0))
