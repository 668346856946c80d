"""A term of the cost of a plume over time, linear or quadratic in the concentration."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, conservative_resample


@dataclass(frozen=True)
class CostTerm:
    """The sum over all cells of `linear` c + `quadratic` (c - `target`)^2.

    It is integrated from `start` to `end` [s] after the first state, or taken at `end` where both
    are equal. The maps (nz, nx) are None where they are zero.

    Attributes:
        start, end: times [s].
        linear: weight of the concentration [m^3].
        quadratic: weight of the squared difference from the target [m^3].
        target: the wanted concentration [-].
    """

    start: float
    end: float
    linear: FloatArray | None = None
    quadratic: FloatArray | None = None
    target: FloatArray | None = None

    @property
    def is_running(self) -> bool:
        """Whether the term is integrated over time."""
        return self.end > self.start

    def value(self, concentration: FloatArray) -> float:
        """Return the term of one map (nz, nx) [m^3]."""
        total = 0.0
        if self.linear is not None:
            total += float(np.vdot(self.linear, concentration))
        if self.quadratic is not None:
            total += float(np.vdot(self.quadratic, self._gap(concentration) ** 2))
        return total

    def derivative(self, concentration: FloatArray) -> FloatArray:
        """Return the derivative (nz, nx) [m^3] of `value` by the concentration of every cell."""
        bar = np.zeros(concentration.shape)
        if self.linear is not None:
            bar += self.linear
        if self.quadratic is not None:
            bar += 2.0 * self.quadratic * self._gap(concentration)
        return bar

    def _gap(self, concentration: FloatArray) -> FloatArray:
        return concentration if self.target is None else concentration - self.target

    def weighted(self, weight: float) -> Self:
        """Return `weight` [-] times the term."""
        linear = None if self.linear is None else weight * self.linear
        quadratic = None if self.quadratic is None else weight * self.quadratic
        return type(self)(self.start, self.end, linear, quadratic, self.target)

    def on_cells(self, shape: tuple[int, int]) -> Self:
        """Return the term for maps of another `shape` (nz, nx) of the same rig.

        Weights are amounts and keep their sum; the target is averaged.
        """

        def amount(values: FloatArray | None) -> FloatArray | None:
            if values is None:
                return None
            return conservative_resample(values, shape) * (values.size / math.prod(shape))

        target = None if self.target is None else conservative_resample(self.target, shape)
        return type(self)(self.start, self.end, amount(self.linear), amount(self.quadratic), target)

    def check(self, shape: tuple[int, int], horizon: float) -> None:
        """Check that the term fits maps of `shape` (nz, nx) over `horizon` [s].

        Raises:
            InputError: the times lie outside the horizon, or a map is not finite or of another
                shape.
        """
        if not 0.0 <= self.start <= self.end <= horizon:
            raise InputError(
                f'cost term from {self.start:g} s to {self.end:g} s: '
                f'must lie within 0 to {horizon:g} s'
            )
        for name in ('linear', 'quadratic', 'target'):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape != shape:
                raise InputError(
                    f'cost term, {name}: a map of {values.shape} cells on a grid of {shape} '
                    '(rows, columns); resample it'
                )
            if not np.isfinite(values).all():
                raise InputError(f'cost term, {name}: not finite everywhere; send finite weights')
