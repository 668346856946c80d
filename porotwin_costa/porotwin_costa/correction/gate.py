"""The safety gate: sigma is withheld where the network would have to extrapolate."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from porotwin_core.basis.units import to_ml_h
from porotwin_core.geometry.grid import FloatArray

Range = tuple[float, float]
"""Smallest and largest value."""

MARGIN = 0.05
"""Allowed distance outside a trained range, as a share of its width [-]: room for noise."""

SIGMA_MARGIN = 1.5
"""Largest plausible |sigma| divided by the largest training residual [-]."""

IN_ML_H = '[ml/h]'
"""End of the names of rates in a message."""

ROUND_OFF = 1e-12
"""Allowed distance outside a range of zero width, such as the rate of an idle well."""


@dataclass(frozen=True)
class TrainingRange:
    """Ranges over the training data.

    `rates` and `tracer_rates` [m^3/s] hold a range per well, `pumping` [m^3/s] the sum of the sizes
    of all rates. `concentration` [-] ranges over all cells, `tracer` [-] over the means of the
    maps. `largest_residual` [1/s] is the largest size of a residual in a cell.
    """

    rates: tuple[Range, ...]
    tracer_rates: tuple[Range, ...]
    pumping: Range
    concentration: Range
    tracer: Range
    largest_residual: float

    @classmethod
    def of(cls, predicted: FloatArray, rates: FloatArray, residual: FloatArray) -> Self:
        """Return the ranges over n samples.

        Args:
            predicted: predictions [-], (n, nz, nx).
            rates: water rate and tracer rate of each well [m^3/s], (n, wells, 2).
            residual: residuals [1/s], (n, nz, nx).
        """
        return cls(
            rates=_ranges(rates[..., 0]),
            tracer_rates=_ranges(rates[..., 1]),
            pumping=_range(np.abs(rates[..., 0]).sum(axis=1)),
            concentration=_range(predicted),
            tracer=_range(predicted.mean(axis=(1, 2))),
            largest_residual=float(np.abs(residual).max()),
        )

    @classmethod
    def from_description(cls, ranges: Mapping[str, Any]) -> Self:
        """Return the ranges in a description as JSON keeps it, with lists for tuples.

        Raises:
            KeyError: a range is missing.
        """

        def pair(values: Sequence[float]) -> Range:
            return float(values[0]), float(values[1])

        return cls(
            rates=tuple(pair(values) for values in ranges['rates']),
            tracer_rates=tuple(pair(values) for values in ranges['tracer_rates']),
            pumping=pair(ranges['pumping']),
            concentration=pair(ranges['concentration']),
            tracer=pair(ranges['tracer']),
            largest_residual=float(ranges['largest_residual']),
        )

    def widened(self, low: float, high: float) -> Self:
        """Return the range for rates between `low` and `high` times the trained ones."""

        def wider(trained: Range) -> Range:
            ends = [trained[0], trained[1], *(end * by for end in trained for by in (low, high))]
            return min(ends), max(ends)

        return replace(
            self,
            rates=tuple(wider(trained) for trained in self.rates),
            tracer_rates=tuple(wider(trained) for trained in self.tracer_rates),
            pumping=wider(self.pumping),
        )

    def objection(
        self, predicted: FloatArray, rates: FloatArray, wells: Sequence[str], *, whole_field: bool
    ) -> str:
        """Return why the inputs lie outside the training data, or an empty string.

        Args:
            predicted: the predicted concentration (nz, nx).
            rates: water rate and tracer rate of each well [m^3/s], (wells, 2).
            wells: the names of the wells, for the message.
            whole_field: whether the network reads the whole map. Such a network knows only the
                rates of each well and the mean concentrations of its training. Another network
                reads a neighbourhood, so only the sum of all rates is limited.
        """
        if not np.isfinite(predicted).all():
            return 'the prediction holds unknown cells'
        for name, (low, high), values in self._checks(predicted, rates, wells, whole_field):
            slack = MARGIN * (high - low) + ROUND_OFF
            for value in values:
                if not low - slack <= value <= high + slack:
                    told = [_told(name, number) for number in (value, low, high)]
                    return '{} {} outside the trained {} to {}'.format(name, *told)
        return ''

    def _checks(
        self, predicted: FloatArray, rates: FloatArray, wells: Sequence[str], whole_field: bool
    ) -> Iterator[tuple[str, Range, list[float]]]:
        """Yield the name of each checked quantity, its trained range and its values."""
        yield 'concentration', self.concentration, [predicted.min(), predicted.max()]
        if not whole_field:
            yield f'pumping {IN_ML_H}', (0.0, self.pumping[1]), [np.abs(rates[:, 0]).sum()]
            return
        yield 'mean concentration', self.tracer, [predicted.mean()]
        for well, trained, rate in zip(wells, self.rates, rates[:, 0], strict=True):
            yield f"rate of '{well}' {IN_ML_H}", trained, [rate]
        for well, trained, rate in zip(wells, self.tracer_rates, rates[:, 1], strict=True):
            yield f"tracer rate of '{well}' {IN_ML_H}", trained, [rate]

    def objection_to(self, sigma: FloatArray) -> str:
        """Return why sigma (nz, nx) [1/s] is implausible, or an empty string."""
        if not np.isfinite(sigma).all():
            return 'the network answered with numbers that are not finite'
        largest = float(np.abs(sigma).max())
        limit = SIGMA_MARGIN * self.largest_residual
        if largest > limit:
            return f'corrective source of {largest:.3g} 1/s exceeds the plausible {limit:.3g} 1/s'
        return ''


def _told(name: str, value: float) -> str:
    """Return `value` as the message tells it: a rate in ml/h."""
    return f'{to_ml_h(value):.0f}' if name.endswith(IN_ML_H) else f'{value:.3g}'


def _range(values: ArrayLike) -> Range:
    return float(np.min(values)), float(np.max(values))


def _ranges(rates: FloatArray) -> tuple[Range, ...]:
    return tuple(_range(well) for well in rates.T)
