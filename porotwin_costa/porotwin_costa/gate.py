"""What the network has seen, and whether a question lies within it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from porotwin_core.grid import FloatArray

Range = tuple[float, float]

MARGIN = 0.05
"""How far outside the seen range a value may lie, as a share of the width of that range."""

SIGMA_MARGIN = 1.5
"""How much larger than any residual in training a corrective source may be."""


@dataclass(frozen=True)
class TrainingRange:
    """Ranges over the training set; a network that extrapolates is not to be trusted.

    `rates` and `tracer_rates` [m^3/s] are per well, `pumping` [m^3/s] the sum of their sizes,
    `concentration` [-] the least and largest cell, `tracer` [-] the mean over the rig,
    `largest_residual` [1/s] the size of any cell's.
    """

    rates: tuple[Range, ...]
    tracer_rates: tuple[Range, ...]
    pumping: Range
    concentration: Range
    tracer: Range
    largest_residual: float

    @classmethod
    def of(cls, predicted: FloatArray, rates: FloatArray, residual: FloatArray) -> Self:
        """Return the ranges over samples: (n, nz, nx), (n, wells, 2), (n, nz, nx)."""
        return cls(
            rates=_ranges(rates[..., 0]),
            tracer_rates=_ranges(rates[..., 1]),
            pumping=_range(np.abs(rates[..., 0]).sum(axis=1)),
            concentration=_range(predicted),
            tracer=_range(predicted.mean(axis=(1, 2))),
            largest_residual=float(np.abs(residual).max()),
        )

    def objection(
        self, predicted: FloatArray, rates: FloatArray, wells: Sequence[str], *, whole_field: bool
    ) -> str:
        """Return why (predicted (nz, nx), rates (wells, 2)) lies outside, or an empty string.

        A network that looks at the `whole_field` at once knows only the rates of each well and the
        amounts of tracer that it has seen; one that looks at a neighbourhood is bound by the
        strength of all pumping instead.
        """
        if not np.isfinite(predicted).all():
            return 'the prediction holds unknown cells'
        checks = [('concentration', self.concentration, [predicted.min(), predicted.max()])]
        if whole_field:
            checks.append(('mean concentration', self.tracer, [predicted.mean()]))
            checks += [
                (f"rate of '{well}' [m^3/s]", seen, [rate])
                for well, seen, rate in zip(wells, self.rates, rates[:, 0], strict=True)
            ]
            checks += [
                (f"tracer rate of '{well}' [m^3/s]", seen, [rate])
                for well, seen, rate in zip(wells, self.tracer_rates, rates[:, 1], strict=True)
            ]
        else:
            pumping = np.abs(rates[:, 0]).sum()
            checks.append(('pumping [m^3/s]', (0.0, self.pumping[1]), [pumping]))
        for name, (low, high), values in checks:
            slack = MARGIN * (high - low) + 1e-12
            for value in values:
                if not low - slack <= value <= high + slack:
                    return f'{name} {value:.3g} outside the trained {low:.3g} to {high:.3g}'
        return ''

    def objection_to(self, sigma: FloatArray) -> str:
        """Return why a corrective source [1/s] cannot be right, or an empty string."""
        if not np.isfinite(sigma).all():
            return 'the network answered with numbers that are not finite'
        largest = float(np.abs(sigma).max())
        limit = SIGMA_MARGIN * self.largest_residual
        if largest > limit:
            return f'corrective source of {largest:.3g} 1/s exceeds the plausible {limit:.3g} 1/s'
        return ''


def _range(values: ArrayLike) -> Range:
    return float(np.min(values)), float(np.max(values))


def _ranges(rates: FloatArray) -> tuple[Range, ...]:
    return tuple(_range(well) for well in rates.T)
