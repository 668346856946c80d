"""Shadow forecasts: forecasts with an accepted effect beside forecasts without it.

Both models start from the same photograph and run freely, so that a small difference of the physics
grows over several photographs while the noise of the maps does not.
"""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np

from porotwin_core.geometry.grid import FloatArray, fill_unseen, relative_error
from porotwin_core.rates.rate_periods import RatePeriod
from porotwin_solver.model.model import Model

WATCHED = 12
"""Photographs that judge an accepted effect: some minutes, in which a plume moves by several
cells."""

LEAST_WATCHED = 4
"""Photographs before an effect is taken back: fewer may be a passing hand."""

WORSE = 1.05
"""Ratio of the errors with and without an effect; above it, the effect makes forecasts worse."""

LEAST_DIFFERENCE = 0.002
"""Least difference of two relative errors that means anything [-]."""


class ShadowJudgement(Enum):
    """The judgement of the photographs on an accepted effect."""

    WATCHING = 'not enough photographs yet'
    KEPT = 'as good as without, or better'
    WORSE = 'worse than without'


class ShadowForecast:
    """Two models of one rig from one photograph on: with the accepted effects and without."""

    def __init__(self, mended: Model, before: Model) -> None:
        """Compare `mended`, with the effects, with the model `before` them."""
        self._models = mended, before
        self._states: tuple[FloatArray, ...] | None = None
        self._errors: list[tuple[float, float]] = []

    def interrupt(self) -> None:
        """Start again from the next photograph, which does not follow from the last one."""
        self._states = None

    @property
    def photographs(self) -> int:
        """Number of photographs that were forecast."""
        return len(self._errors)

    @property
    def errors(self) -> tuple[float, float]:
        """Root mean square of the relative errors with and without the effects [-]."""
        if not self._errors:
            return math.nan, math.nan
        with_effects, without = np.sqrt(np.mean(np.square(self._errors), axis=0))
        return float(with_effects), float(without)

    @property
    def in_words(self) -> str:
        """The errors in one sentence."""
        with_effects, without = (f'{100.0 * error:.2g} %' for error in self.errors)
        return (
            f'the forecasts of {self.photographs} photographs erred by {with_effects} with it and '
            f'by {without} without it.'
        )

    def see(self, observed: FloatArray, periods: Sequence[RatePeriod]) -> ShadowJudgement:
        """Return the judgement of the photograph `observed` (nz, nx) [-] and all before it.

        Args:
            observed: its map; NaN where nothing was seen.
            periods: the consecutive rates since the last photograph; empty after an interruption.

        Raises:
            InputError: a model cannot run with these rates.
        """
        if self._states is None or not periods:
            first = np.clip(fill_unseen(observed, None), 0.0, 1.0)
            self._states = (first, first)
            return self._judgement()
        self._states = tuple(
            _advanced(model, state, periods)
            for model, state in zip(self._models, self._states, strict=True)
        )
        mended, before = (relative_error(state, observed) for state in self._states)
        if math.isfinite(mended) and math.isfinite(before):
            self._errors.append((mended, before))
        return self._judgement()

    def _judgement(self) -> ShadowJudgement:
        mended, before = self.errors
        if self.photographs >= LEAST_WATCHED and mended > max(
            WORSE * before, before + LEAST_DIFFERENCE
        ):
            return ShadowJudgement.WORSE
        return ShadowJudgement.KEPT if self.photographs >= WATCHED else ShadowJudgement.WATCHING


def _advanced(model: Model, state: FloatArray, periods: Sequence[RatePeriod]) -> FloatArray:
    for period in periods:
        state = model.predict(state, period.rates, period.end - period.start)
    return state
