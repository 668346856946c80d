"""The person at the pumps of a scenario: prompt or late, exact or not, willing or not."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from porotwin_core.basis.units import percent
from porotwin_core.rates.rate_periods import same_rates
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.setpoint_limits import Limits

REFUSAL_PHOTOGRAPHS = 6
"""Photographs over which an operator who has refused an order sets nothing: some minutes."""


@dataclass(frozen=True)
class Operator:
    """How a person follows orders.

    Attributes:
        late: photographs between an order and its setting.
        slips: probability that one well of an order is set at another rate.
        refuses: probability that an order is refused.
    """

    late: int = 0
    slips: float = 0.0
    refuses: float = 0.0

    def __str__(self) -> str:
        """Return the person in words."""
        if self.late:
            return f'operator late by {self.late}'
        if self.slips:
            return f'operator sets other rates ({percent(self.slips)})'
        if self.refuses:
            return f'operator refuses ({percent(self.refuses)})'
        return 'operator prompt'


class OperatorAtWork:
    """A person over one experiment; the same seed makes the same mistakes."""

    def __init__(self, operator: Operator, limits: Limits, *, seed: int) -> None:
        """Begin with the safe rates at the pumps."""
        self._operator = operator
        self._limits = limits
        self._chance = np.random.default_rng([seed, 11])
        self._shown: deque[WellRates] = deque(maxlen=operator.late + 1)
        self._read: WellRates = limits.safe()
        self._set: WellRates = limits.safe()
        self._refusing = 0

    def follow(self, order: WellRates) -> tuple[WellRates, bool]:
        """Return the rates at the pumps [m^3/s] until the next photograph; whether they are new.

        `order` is the setpoint that is shown now. It is called once per photograph.
        """
        self._shown.append(order)
        if len(self._shown) <= self._operator.late:
            return self._set, False
        self._refusing = max(0, self._refusing - 1)
        read = self._shown[0]
        if same_rates(read, self._read) or self._refusing:
            return self._set, False
        if self._chance.random() < self._operator.refuses:
            self._refusing = REFUSAL_PHOTOGRAPHS
            return self._set, False
        self._read = read
        self._set = self._with_slip(read)
        return self._set, True

    def _with_slip(self, order: WellRates) -> WellRates:
        """Return the order as it is set; after a slip one well has another rate."""
        slips = self._chance.random() < self._operator.slips
        well, share = self._chance.integers(len(self._limits.wells)), self._chance.random()
        if not slips:
            return order
        rates = self._limits.control_rates(order)
        rates[well] = share * self._limits.max_rate
        return self._limits.setpoint(rates)
