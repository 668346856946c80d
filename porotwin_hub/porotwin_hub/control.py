"""Choosing the control wells' rates within the rig's limits (paper, section 4).

The limits hold by construction of every setpoint, not by trust in an optimiser: `Limits.setpoint`
turns any numbers into rates that keep them, and `Limits.violations` is asked again before rates
leave the hub.
"""

import contextlib
import math
import time
from collections.abc import Callable, Sized
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray
from porotwin_core.rig import Rig
from porotwin_core.units import from_ml_h, to_ml_h
from porotwin_core.wells import WellRate, WellRates, net_rate

PUMP_STEP_ML_H = 0.1
"""What a pump's display can be set to [ml/h]; setpoints are rounded down to it."""

TOLERANCE = from_ml_h(1e-6)
"""Round-off allowed in sums of rates [m^3/s]."""

CONCENTRATION_TOLERANCE = 1e-6
"""Round-off allowed in injected concentrations."""

CostFn = Callable[[WellRates], float]
"""The cost of pumping some rates; raises when it cannot be known."""


@dataclass(frozen=True)
class Limits:
    """What the twin may ask of the wells; rates in m^3/s."""

    wells: tuple[str, ...]
    producer: str | None
    fixed: dict[str, WellRate]
    max_rate: float
    max_total_rate: float
    all_wells: tuple[str, ...]

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
            max_total_rate=from_ml_h(control.max_total_rate_ml_h),
            all_wells=tuple(rig.wells),
        )

    def setpoint(self, control_rates: FloatArray) -> dict[str, WellRate]:
        """Return the rates of every well for wished `control_rates` (wells,) [m^3/s].

        Not-finite wishes count as zero; each is cut to [0, max_rate], all are scaled down together
        to max_total_rate, rounded down to the pump's step, and the producer balances the sum.
        """
        wished = np.nan_to_num(np.asarray(control_rates, dtype=float), nan=0.0, posinf=0.0)
        rates = np.clip(wished, 0.0, self.max_rate)
        total = rates.sum()
        if total > self.max_total_rate:
            rates *= self.max_total_rate / total
        # the small lift keeps a rate that is a whole step from falling to the step below
        steps = np.floor(to_ml_h(1.0) * rates / PUMP_STEP_ML_H + 1e-6)
        rates = steps * from_ml_h(PUMP_STEP_ML_H)
        chosen = {name: WellRate(float(rate)) for name, rate in zip(self.wells, rates, strict=True)}
        result = {name: WellRate() for name in self.all_wells} | self.fixed | chosen
        if self.producer is not None:
            result[self.producer] = WellRate(-net_rate(result))
        return result

    def safe(self) -> dict[str, WellRate]:
        """Return the rates without control: fixed wells as ever, balanced by the producer."""
        return self.setpoint(np.zeros(len(self.wells)))

    def control_rates(self, rates: WellRates) -> FloatArray:
        """Return the control wells' part of `rates`, shape (wells,) [m^3/s]."""
        return np.array([rates.get(name, WellRate()).rate for name in self.wells])

    def violations(self, rates: WellRates) -> list[str]:
        """Return a line for every limit that `rates` break; empty when all hold."""
        lines = [
            f"well '{name}' is not in the rig; known: {', '.join(self.all_wells)}"
            for name in rates
            if name not in self.all_wells
        ]
        control = self.control_rates(rates)
        for name, rate in zip(self.wells, control, strict=True):
            if not -TOLERANCE <= rate <= self.max_rate + TOLERANCE:
                lines.append(
                    f"well '{name}': {to_ml_h(rate):.1f} ml/h lies outside "
                    f'0 to {to_ml_h(self.max_rate):.1f} ml/h'
                )
        if math.fsum(control) > self.max_total_rate + TOLERANCE:
            lines.append(
                f'control wells inject {to_ml_h(math.fsum(control)):.1f} ml/h together, '
                f'more than {to_ml_h(self.max_total_rate):.1f} ml/h'
            )
        lines += self._in_the_wrong_role(rates)
        for name, well in self.fixed.items():
            if abs(rates.get(name, WellRate()).rate - well.rate) > TOLERANCE:
                lines.append(f"well '{name}' must stay at {to_ml_h(well.rate):.1f} ml/h")
        if self.producer is not None and abs(net_rate(rates)) > TOLERANCE:
            lines.append(
                f'{to_ml_h(net_rate(rates)):.1f} ml/h more is injected than produced; '
                'the net rate must be zero'
            )
        return lines

    def _in_the_wrong_role(self, rates: WellRates) -> list[str]:
        """Return a line for every idle well that pumps, and every well that injects another fluid.

        Tracer comes from the fixed wells only; what the twin may choose is water.
        """
        lines = []
        for name, well in rates.items():
            if abs(well.rate) <= TOLERANCE or name not in self.all_wells:
                continue
            if name != self.producer and name not in self.wells and name not in self.fixed:
                lines.append(
                    f"well '{name}': {to_ml_h(well.rate):.1f} ml/h, but control gives it no role"
                )
            fluid = self.fixed.get(name, WellRate()).concentration
            if well.rate > 0.0 and abs(well.concentration - fluid) > CONCENTRATION_TOLERANCE:
                lines.append(
                    f"well '{name}' injects concentration {well.concentration:g}, must be {fluid:g}"
                )
        return lines


@dataclass(frozen=True)
class Decision:
    """The rates chosen, their cost, and how they were found."""

    rates: dict[str, WellRate]
    cost: float
    cost_unchanged: float
    evaluations: int


class _OutOfTimeError(Exception):
    """The time for an optimisation is over."""


def optimise(
    limits: Limits,
    cost: CostFn,
    previous: WellRates,
    *,
    evaluations: int,
    patience: float = math.inf,
) -> Decision:
    """Return the rates of least cost that COBYLA (Powell 1994) finds within the limits.

    It starts from the best of the previous rates, no control, and each control well alone at its
    maximum, since the cost has several valleys. What is returned is the best point that was
    evaluated, not the last: COBYLA may end on a worse one. Every evaluated point is a setpoint
    that keeps the limits, rounded as the pumps will round it. After `patience` [s of wall time] no
    further point is evaluated; the previous rates always are.
    """
    deadline = time.monotonic() + patience
    seen: dict[tuple[float, ...], float] = {}

    def cost_of(control_rates: FloatArray) -> float:
        rates = limits.setpoint(control_rates)
        key = tuple(limits.control_rates(rates))
        if key not in seen:
            if seen and time.monotonic() > deadline:
                raise _OutOfTimeError
            seen[key] = cost(rates)
        return seen[key]

    unchanged = cost_of(limits.control_rates(previous))
    with contextlib.suppress(_OutOfTimeError):
        _search(limits, cost_of, limits.control_rates(previous), seen, evaluations)
    best = min(seen, key=lambda key: seen[key])
    return Decision(
        rates=limits.setpoint(np.array(best)),
        cost=seen[best],
        cost_unchanged=unchanged,
        evaluations=len(seen),
    )


def _search(
    limits: Limits,
    cost_of: Callable[[FloatArray], float],
    unchanged: FloatArray,
    seen: Sized,
    evaluations: int,
) -> None:
    """Evaluate the starts, then what COBYLA asks for from the best of them."""
    starts = [
        unchanged,
        np.zeros(len(limits.wells)),
        *(np.eye(len(limits.wells)) * limits.max_rate),
    ]
    costs = [cost_of(start) for start in starts]
    scale = limits.max_rate

    remaining = evaluations - len(seen)
    if remaining > 0 and max(costs) > 0:
        bounds = [
            {'type': 'ineq', 'fun': lambda c, i=i: c[i]} for i in range(len(limits.wells))
        ] + [{'type': 'ineq', 'fun': lambda c, i=i: 1.0 - c[i]} for i in range(len(limits.wells))]
        total = {'type': 'ineq', 'fun': lambda c: limits.max_total_rate / scale - c.sum()}
        minimize(
            lambda c: cost_of(c * scale) / max(costs),
            starts[int(np.argmin(costs))] / scale,
            method='COBYLA',
            constraints=[*bounds, total],
            options={'rhobeg': 0.25, 'tol': 2e-3, 'maxiter': remaining},
        )
