"""Plans of the control wells: rates over blocks of time, and their stages between two orders."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rates.order_delay import LEAST_DELAY_S
from porotwin_core.rates.rate_periods import SAME_RATE
from porotwin_core.rates.wells import WellRates
from porotwin_hub.control.setpoint_limits import Limits

FIRST_BLOCK_S = 60.0
"""Length of the first block [s]: two photo intervals, the time scale of an order by hand."""

GROWTH = 1.3
"""Length of a block over the one before: an hour takes eleven blocks. A far change is seen in time
without its exact moment, which is found when it comes near."""


@dataclass(frozen=True)
class ControlPlan:
    """Rates of the control wells over time.

    Attributes:
        starts: beginnings of the blocks after the state [s], (blocks,), the first one 0.
        rates: of every control well in every block [m^3/s], (blocks, wells).
        horizon: end of the last block [s].
    """

    starts: FloatArray
    rates: FloatArray
    horizon: float

    @classmethod
    def constant(cls, rates: FloatArray, horizon: float) -> Self:
        """Return the plan with the same `rates` (wells,) up to `horizon` [s]."""
        return cls(np.zeros(1), np.array([rates], dtype=float), horizon)

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the blocks [s], (blocks,)."""
        return np.diff(np.append(self.starts, self.horizon))

    def on_blocks(self, starts: FloatArray) -> 'ControlPlan':
        """Return the plan on other blocks: each has the rates at its beginning."""
        block = np.searchsorted(self.starts, starts + 1e-9, side='right') - 1
        return ControlPlan(starts, self.rates[block], self.horizon)

    def after(self, elapsed: float, horizon: float) -> 'ControlPlan':
        """Return the rest of the plan after `elapsed` [s], up to `horizon` [s] from then on.

        A change that is due within half a photo interval comes at once.
        """
        moved = self.starts - elapsed
        first = int(np.searchsorted(moved, LEAST_DELAY_S, side='right')) - 1
        later = moved[first + 1 :]
        later = later[later < horizon - LEAST_DELAY_S]
        rates = self.rates[first : first + 1 + len(later)]
        return ControlPlan(np.append(0.0, later), rates, horizon)

    def stages(self) -> 'ControlPlan':
        """Return the same rates in as few blocks as possible: one for each order."""
        changed = [not same(b, a) for a, b in itertools.pairwise(self.rates)]
        kept = np.flatnonzero([True, *changed])
        return ControlPlan(self.starts[kept], self.rates[kept], self.horizon)

    def orders(self, previous: FloatArray) -> int:
        """Return how often rates change, `previous` (wells,) being those before the plan."""
        seen = [previous, *self.rates]
        return sum(not same(a, b) for a, b in itertools.pairwise(seen))

    def executable(self, limits: Limits, previous: WellRates, interval: float) -> 'ControlPlan':
        """Return the plan as the pumps can be set, after the `previous` rates.

        Where a rate may not change as far as planned at once, it changes with every setpoint, each
        `interval` [s].
        """
        starts: list[float] = []
        rates: list[FloatArray] = []
        ends = [*self.starts[1:], self.horizon]
        for start, end, wanted in zip(self.starts, ends, self.rates, strict=True):
            moment, target = float(start), limits.setpoint(wanted)
            while not starts or moment < end:
                previous = limits.setpoint(wanted, previous)
                starts.append(moment)
                rates.append(limits.control_rates(previous))
                if previous == target:
                    break
                moment += interval
        return ControlPlan(np.array(starts), np.array(rates), self.horizon)

    def without_change(self, number: int, previous: FloatArray) -> 'ControlPlan':
        """Return stages with one order less: stage `number` takes part in the one before.

        Both get their mean rate over time. The first stage takes the `previous` rates, and so does
        the second one where it follows them.
        """
        rates, lengths = self.rates, self.lengths
        if number == 0:
            return ControlPlan(self.starts, np.vstack([[previous], rates[1:]]), self.horizon)
        pair = slice(number - 1, number + 1)
        joined = lengths[pair] @ rates[pair] / lengths[pair].sum()
        if number == 1 and same(rates[0], previous):
            joined = previous
        return ControlPlan(
            np.delete(self.starts, number),
            np.vstack([rates[: number - 1], [joined], rates[number + 1 :]]),
            self.horizon,
        )

    def easiest_changes(self, previous: FloatArray) -> list[int]:
        """Return the numbers of the stages, those whose order moves the least water first."""
        seen = np.vstack([[previous], self.rates])
        step = np.abs(np.diff(seen, axis=0)).max(axis=1)
        lengths = self.lengths
        beside = np.minimum(lengths, np.append(np.inf, lengths[:-1]))
        order = np.argsort(step * beside)
        return [int(number) for number in order if step[number] > SAME_RATE]


def same(one: FloatArray, other: FloatArray) -> bool:
    """Return whether both are the same settings of the pumps, (wells,) [m^3/s]."""
    return bool(np.abs(one - other).max(initial=0.0) <= SAME_RATE)


def growing_blocks(horizon: float, own: Sequence[float] | FloatArray = ()) -> FloatArray:
    """Return the beginnings of blocks of growing length up to `horizon` [s], (blocks,).

    The moments `own` [s] are among them; others too close to one of these are left out.
    """
    kept = [0.0, *(float(time) for time in own if LEAST_DELAY_S < time < horizon)]
    start, length = 0.0, FIRST_BLOCK_S
    while start + length < horizon - 0.5 * length:
        start, length = start + length, GROWTH * length
        if min(abs(start - time) for time in kept) > LEAST_DELAY_S:
            kept.append(start)
    return np.array(sorted(set(kept)))
