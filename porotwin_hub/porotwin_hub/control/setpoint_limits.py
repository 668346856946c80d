"""The limits of setpoints: which rates the twin may command (paper, section 4).

Every setpoint keeps the limits by construction: `Limits.setpoint` turns any numbers into rates
within them. `Limits.violations` is an independent check before rates leave the hub.
"""

import math
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.floors import WRITTEN_ROUND_OFF
from porotwin_core.basis.units import from_ml_h, to_ml_h
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.wells import WellRate, WellRates, net_rate, net_rate_words
from porotwin_core.rig import PUMP_STEP_ML_H, Rig

RATE_TOLERANCE = from_ml_h(1e-6)
"""Round-off allowed in sums of rates [m^3/s]."""


@dataclass(frozen=True)
class Limits:
    """The rates that the twin may command [m^3/s].

    `wells` are the control wells in the order of the optimiser's variables; `fixed` wells keep
    their rates; `producer` balances all others; every other well of `all_wells` stays off.
    `max_rate` [m^3/s] bounds the rate of each control well, `max_total_rate` [m^3/s] their sum.
    Rates are multiples of `step` [m^3/s]. A control well that pumps has at least `min_rate`
    [m^3/s]. `max_change` [m^3/s] bounds the change of one rate from one setpoint to the next; the
    safe rates are always allowed. The producer takes out at most `max_producer_rate` [m^3/s];
    `max_total_rate` allows for it, as `max_total_words` tell. `pausing` wells are fixed ones with
    announced pauses.
    """

    wells: tuple[str, ...]
    producer: str | None
    fixed: dict[str, WellRate]
    max_rate: float
    max_total_rate: float
    all_wells: tuple[str, ...]
    step: float = from_ml_h(PUMP_STEP_ML_H)
    min_rate: float = 0.0
    max_change: float = math.inf
    max_producer_rate: float = math.inf
    pausing: frozenset[str] = frozenset()
    max_total_words: str = ''

    @classmethod
    def of(cls, rig: Rig) -> 'Limits':
        """Return the limits of a rig.

        Raises:
            InputError: the rig has no control section.
        """
        if rig.control is None:
            raise InputError(f"rig '{rig.name}' has no control section; add one to rig.yaml")
        control = rig.control
        return cls(
            wells=control.wells,
            producer=control.producer,
            fixed={
                name: WellRate(from_ml_h(well.rate_ml_h), well.concentration)
                for name, well in control.fixed.items()
            },
            max_rate=from_ml_h(control.max_rate_ml_h),
            max_total_rate=from_ml_h(control.most_total_ml_h),
            all_wells=tuple(rig.wells),
            step=from_ml_h(control.rate_step_ml_h),
            min_rate=from_ml_h(control.min_rate_ml_h),
            max_change=from_ml_h(control.max_change_ml_h or math.inf),
            max_producer_rate=from_ml_h(control.max_producer_rate_ml_h or math.inf),
            pausing=frozenset(n for n, well in control.fixed.items() if well.pauses_min),
            max_total_words=control.most_total_words,
        )

    def setpoint(
        self, control_rates: FloatArray, previous: WellRates | None = None
    ) -> dict[str, WellRate]:
        """Return the rates of every well for proposed `control_rates` (wells,) [m^3/s].

        A proposal that is not finite counts as zero. Each rate is cut to [0, max_rate], all are
        scaled down together to max_total_rate and rounded down to the pump's step. A rate below
        the smallest one becomes that or zero, whichever is nearer and possible. After the
        `previous` rates no rate changes by more than max_change. The producer balances the sum.
        """
        proposed = np.nan_to_num(np.asarray(control_rates, dtype=float), nan=0.0, posinf=0.0)
        low, high = self._reach(previous)
        rates = np.clip(proposed, low, high)
        if rates.sum() > self.max_total_rate:
            free = max((rates - low).sum(), np.finfo(float).tiny)
            rates = low + (rates - low) * max(self.max_total_rate - low.sum(), 0.0) / free
        rates = self._not_below_the_least(np.maximum(self._rounded_down(rates), low), high)
        chosen = {name: WellRate(float(rate)) for name, rate in zip(self.wells, rates, strict=True)}
        result = {name: WellRate() for name in self.all_wells} | self.fixed | chosen
        if self.producer is not None:
            result[self.producer] = WellRate(-net_rate(result))
        return result

    def _reach(self, previous: WellRates | None) -> tuple[FloatArray, FloatArray]:
        """Return the least and the greatest rate of each control well, whole steps [m^3/s]."""
        greatest = np.full(len(self.wells), self._rounded_down(np.array(self.max_rate)))
        if previous is None or math.isinf(self.max_change):
            return np.zeros(len(self.wells)), greatest
        before = np.clip(self.control_rates(previous), 0.0, greatest)
        lowest = np.maximum(before - self.max_change, 0.0)
        low = np.ceil(lowest / self.step - WRITTEN_ROUND_OFF) * self.step
        low = np.where(low > 0.0, np.maximum(low, self._least), 0.0)
        return low, np.minimum(greatest, self._rounded_down(before + self.max_change))

    @property
    def _least(self) -> float:
        """The smallest rate of a well that pumps, whole steps [m^3/s]."""
        return math.ceil(self.min_rate / self.step - WRITTEN_ROUND_OFF) * self.step

    def _rounded_down(self, rates: FloatArray) -> FloatArray:
        return np.asarray(np.floor(rates / self.step + WRITTEN_ROUND_OFF) * self.step)

    def _not_below_the_least(self, rates: FloatArray, high: FloatArray) -> FloatArray:
        """Return `rates` (wells,) [m^3/s] without any between zero and the smallest one."""
        least = self._least
        exact = 1.0 - WRITTEN_ROUND_OFF
        small = (rates > 0.0) & (rates < least * exact)
        chosen = np.where(small, 0.0, rates)
        for well in np.flatnonzero(small & (rates >= 0.5 * least) & (high >= least * exact)):
            if (chosen.sum() + least) * exact <= self.max_total_rate:
                chosen[well] = least
        return chosen

    def safe(self) -> dict[str, WellRate]:
        """Return the safe rates: control wells off, fixed wells on, balanced by the producer."""
        return self.setpoint(np.zeros(len(self.wells)))

    def control_rates(self, rates: WellRates) -> FloatArray:
        """Return the rates of the control wells among `rates`, shape (wells,) [m^3/s]."""
        return np.array([rates.get(name, WellRate()).rate for name in self.wells])

    def violations(self, rates: WellRates, previous: WellRates | None = None) -> list[str]:
        """Return one line for every limit that `rates` break; an empty list if there is none.

        `previous` are the rates of the setpoint before; without them any change is allowed.
        """
        return [
            *self._unknown_wells(rates),
            *self._control_rates_out_of_range(rates),
            *self._rates_that_cannot_be_set(rates, previous),
            *self._wrong_roles(rates),
            *self._changed_fixed_wells(rates),
            *self._imbalance(rates),
        ]

    def _unknown_wells(self, rates: WellRates) -> list[str]:
        return [
            f"well '{name}' is not in the rig; known: {', '.join(self.all_wells)}"
            for name in rates
            if name not in self.all_wells
        ]

    def _control_rates_out_of_range(self, rates: WellRates) -> list[str]:
        control = self.control_rates(rates)
        lines = [
            f"well '{name}': {to_ml_h(rate):.1f} ml/h lies outside "
            f'0 to {to_ml_h(self.max_rate):.1f} ml/h'
            for name, rate in zip(self.wells, control, strict=True)
            if not -RATE_TOLERANCE <= rate <= self.max_rate + RATE_TOLERANCE
        ]
        if math.fsum(control) > self.max_total_rate + RATE_TOLERANCE:
            lines.append(
                f'control wells inject {to_ml_h(math.fsum(control)):.1f} ml/h together, '
                f'more than {self.max_total_words or f"{to_ml_h(self.max_total_rate):.1f} ml/h"}'
            )
        return lines

    def _rates_that_cannot_be_set(self, rates: WellRates, previous: WellRates | None) -> list[str]:
        """Return a line for every control rate off the pump's steps, too small, or too far away."""
        lines = []
        control = self.control_rates(rates)
        before = None if previous is None else self.control_rates(previous)
        for number, (name, rate) in enumerate(zip(self.wells, control, strict=True)):
            told = f"well '{name}': {to_ml_h(rate):.2f} ml/h"
            if abs(rate - round(rate / self.step) * self.step) > RATE_TOLERANCE:
                lines.append(f'{told} is no multiple of {to_ml_h(self.step):g} ml/h')
            if RATE_TOLERANCE < rate < self.min_rate - RATE_TOLERANCE:
                lines.append(f'{told} is below the smallest rate, {to_ml_h(self.min_rate):g} ml/h')
            if before is None or not control.any():
                continue
            if abs(rate - before[number]) > self.max_change + RATE_TOLERANCE:
                lines.append(
                    f'{told} after {to_ml_h(before[number]):.2f} ml/h: rates change by at most '
                    f'{to_ml_h(self.max_change):g} ml/h'
                )
        return lines

    def _wrong_roles(self, rates: WellRates) -> list[str]:
        """Return a line for every well that pumps against its role or injects a wrong fluid.

        Only fixed wells inject tracer; control wells inject water.
        """
        lines = []
        for name, well in rates.items():
            if abs(well.rate) <= RATE_TOLERANCE or name not in self.all_wells:
                continue
            if name != self.producer and name not in self.wells and name not in self.fixed:
                lines.append(
                    f"well '{name}': {to_ml_h(well.rate):.1f} ml/h, but control gives it no role"
                )
            if name == self.producer and well.rate > 0.0:
                lines.append(
                    f"well '{name}': {to_ml_h(well.rate):.1f} ml/h, but the producer never injects"
                )
            if name == self.producer and -well.rate > self.max_producer_rate + RATE_TOLERANCE:
                lines.append(
                    f"well '{name}': {to_ml_h(well.rate):.1f} ml/h, but it takes out at most "
                    f'{to_ml_h(self.max_producer_rate):g} ml/h'
                )
            fluid = self.fixed.get(name, WellRate()).concentration
            if well.rate > 0.0 and abs(well.concentration - fluid) > WRITTEN_ROUND_OFF:
                lines.append(
                    f"well '{name}' injects concentration {well.concentration:g}, must be {fluid:g}"
                )
        return lines

    def _changed_fixed_wells(self, rates: WellRates) -> list[str]:
        return [
            f"well '{name}': {to_ml_h(given):.1f} ml/h, but it must stay at "
            f'{to_ml_h(well.rate):.1f} ml/h'
            for name, well in self.fixed.items()
            if abs((given := rates.get(name, WellRate()).rate) - well.rate) > RATE_TOLERANCE
            and not (name in self.pausing and abs(given) <= RATE_TOLERANCE)
        ]

    def _imbalance(self, rates: WellRates) -> list[str]:
        if self.producer is None or abs(net_rate(rates)) <= RATE_TOLERANCE:
            return []
        return [
            f"{net_rate_words(net_rate(rates))}; with a producer, here '{self.producer}', "
            'the net rate of a setpoint must be zero'
        ]
