"""The form of an unexplained gap, in the words of a physicist.

The remainder between the observed maps and a model that runs from the start is regressed on the
changes that many causes make, to first order. The causes are

- the effects of the library,
- leaks and zones at places all over the rig,
- causes that grow or swing over time: pumps, drifts, the water table,
- a sand with a preferred direction, sorption that depends on the concentration,
- other errors of the camera: light, clock, a signal that lags, a glow.

Causes are chosen one after the other, at most `MOST_TERMS`. Causes are
ranked by two remainders: the one in the fitted frames, and the one in their later part after a fit
to the earlier part.
A further cause must close `LEAST_GAIN` of the held-out remainder for each of its values, and all
together `LEAST_CLOSED`.
The remainder comes from a free run, because one-step residuals of noisy maps are biased.
"""

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.held_out_share import HELD_OUT_SHARE
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.cause import Cause, Place
from porotwin_diagnosis.advice.causes_of_the_camera import causes_of_the_camera
from porotwin_diagnosis.advice.causes_of_the_rig import (
    causes_at_places,
    causes_of_the_library,
    delay_of_pale_tracer,
    preferred_direction,
)
from porotwin_diagnosis.advice.causes_over_time import causes_over_time
from porotwin_diagnosis.advice.free_runs import FreeRuns
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH, Sample, at_compared_cells
from porotwin_diagnosis.model.forward import Forward
from porotwin_solver.effects.retardation import EFFECT as RETARDATION

MOST_TERMS = 3
"""Largest number of terms; more describe noise."""

LEAST_CLOSED = 0.25
"""Share of the held-out remainder below which a description is refused."""

WELL_CLOSED = 0.5
"""Share of the held-out remainder that a good description closes at least, and effects that are a
part of the cause: with less, most of it has another cause."""

LEAST_GAIN = 0.03
"""Share of the held-out remainder that a further term must close for every value that its search
chooses: a moved picture with four values always fits a little."""

RIDGE = 1e-6
"""Weight of the squared coefficients relative to the mean square of the changes: changes that are
nearly equal must not need huge coefficients of opposite sign."""

FREEDOM = 1.05
"""Factor on the remainder for every value that the search for a cause chooses: one of hundreds of
places always fits the noise a little."""


Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Term:
    """One cause of the remainder.

    Attributes:
        name: short name of the cause.
        kind: the process that it changes: source, transport, storage or camera.
        amount: fitted factor of its first change.
        unit: unit of the amount.
        words: the cause with its size, in words.
        check: how to check the cause in the laboratory.
        place: (x, z) [m], or None for a cause of the whole rig.
    """

    name: str
    kind: str
    amount: float
    unit: str
    words: str
    check: str
    place: Place | None = None


@dataclass(frozen=True)
class RemainderForm:
    """A description of a remainder.

    Attributes:
        terms: the causes, the strongest first; empty if no description holds.
        closed: share of the held-out remainder beyond the noise that they close [-].
    """

    terms: tuple[Term, ...]
    closed: float

    @property
    def kind(self) -> str | None:
        """Kind of the strongest cause; None if no description holds."""
        return self.terms[0].kind if self.terms else None

    @property
    def fits_well(self) -> bool:
        """Whether the causes close most of the remainder."""
        return self.closed >= WELL_CLOSED


def describe_remainder(
    forward: Forward,
    given: tuple[EffectDescription, ...] = (),
    *,
    excluded: Sequence[str] = (),
    pool: Executor | None = None,
) -> RemainderForm:
    """Return the form of the remainder beside the model with the effects `given`.

    Args:
        forward: the model of a recording, without a multifidelity correction.
        given: effects of the model.
        excluded: names of library effects that are no causes.
        pool: runs simulations; None for one at a time.

    Raises:
        InputError: the model cannot run with `given`.
    """
    runs = FreeRuns(forward, given)
    sample = runs.sample
    causes = [
        replace(cause, changes=_whitened(sample, cause.changes))
        for cause in chain(
            causes_of_the_library(runs, excluded),
            causes_at_places(runs, excluded, pool),
            causes_over_time(runs),
            preferred_direction(runs),
            [] if RETARDATION.name in excluded else delay_of_pale_tracer(runs),
            causes_of_the_camera(runs),
        )
    ]
    regression = Regression.of(sample, sample.whitened(runs.maps), causes)
    chosen, amounts, closed = _chosen(regression)
    if closed < LEAST_CLOSED:
        return RemainderForm((), closed)
    return RemainderForm(tuple(_terms(chosen, amounts)), closed)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """The normal equations of some frames.

    Attributes:
        gram: products of the changes with each other, (k, k).
        moments: products of the changes with the remainder, (k,).
        square: sum of squares of the remainder.
        noise: the part of `square` that noise alone is expected to make.
    """

    gram: FloatArray
    moments: FloatArray
    square: float
    noise: float

    def solved(self, rows: Indices) -> FloatArray:
        """Return the least squares amounts of the changes `rows`."""
        gram = self.gram[np.ix_(rows, rows)]
        ridge = RIDGE * float(np.trace(gram)) / len(rows) + 1e-30
        return np.linalg.solve(gram + ridge * np.eye(len(rows)), self.moments[rows])

    def left(self, rows: Indices, amounts: FloatArray) -> float:
        """Return the share of `square` that the `amounts` of the changes `rows` leave."""
        gram = self.gram[np.ix_(rows, rows)]
        after = self.square - 2.0 * amounts @ self.moments[rows] + amounts @ gram @ amounts
        return max(float(after), 0.0) / max(self.square, 1e-30)

    def closed(self, left: float) -> float:
        """Return the share of the remainder beyond the noise that closes if `left` is left."""
        if self.square <= 0.0:
            return 0.0
        noise = min(self.noise / self.square, left)
        before = math.sqrt(max(1.0 - noise, 0.0))
        return 1.0 - math.sqrt(left - noise) / before if before else 0.0


@dataclass(frozen=True, eq=False)
class Regression:
    """The normal equations of all causes, for parts of the frames.

    Attributes:
        causes: the causes.
        rows: numbers of the changes of each cause.
        earlier, later: the parts of the fitted frames that rank causes.
        fitted, held_out: the fitted and the held-out frames.
    """

    causes: tuple[Cause, ...]
    rows: tuple[Indices, ...]
    earlier: NormalEquations
    later: NormalEquations
    fitted: NormalEquations
    held_out: NormalEquations

    @classmethod
    def of(cls, sample: Sample, remainder: FloatArray, causes: Sequence[Cause]) -> 'Regression':
        """Return the regression of a whitened `remainder` (nt, nz', nx') on whitened `causes`."""
        changes = np.concatenate([cause.changes for cause in causes])
        ends = np.cumsum([len(cause.changes) for cause in causes])
        rows = [np.arange(end - len(c.changes), end) for c, end in zip(causes, ends, strict=True)]
        fitted, noise = sample.fitted_frames, sample.expected_noise_squares
        half = max(1, round((1.0 - HELD_OUT_SHARE) * fitted))

        def part(frames: slice) -> NormalEquations:
            flat = changes[:, frames].reshape(len(changes), -1)
            left = remainder[frames].ravel().astype(np.float32)
            moments, square = flat @ left, float(left @ left)
            return NormalEquations(
                (flat @ flat.T).astype(float),
                moments.astype(float),
                square,
                float(noise[frames].sum()),
            )

        return cls(
            tuple(causes),
            tuple(rows),
            part(slice(0, half)),
            part(slice(half, fitted)),
            part(slice(0, fitted)),
            part(slice(fitted, None)),
        )

    def rows_of(self, numbers: Iterable[int]) -> Indices:
        """Return the numbers of the changes of the causes `numbers`."""
        return np.concatenate([self.rows[number] for number in numbers])

    def parts_of(self, numbers: Sequence[int], amounts: FloatArray) -> list[FloatArray]:
        """Return the `amounts` of the causes `numbers`, divided by cause."""
        ends = np.cumsum([len(self.rows[number]) for number in numbers])
        return np.split(amounts, ends[:-1])

    def score(self, numbers: Sequence[int]) -> float:
        """Return the remainder beside the causes `numbers`, with `FREEDOM`.

        It is infinite if a cause may not have its amounts.
        """
        rows = self.rows_of(numbers)
        amounts = self.fitted.solved(rows)
        parts = zip(numbers, self.parts_of(numbers, amounts), strict=True)
        if not all(self.causes[number].allows(part.tolist()) for number, part in parts):
            return math.inf
        predicted = self.later.left(rows, self.earlier.solved(rows))
        freedom = sum(self.causes[number].freedom for number in numbers)
        return 0.5 * (self.fitted.left(rows, amounts) + predicted) * FREEDOM**freedom


def _whitened(sample: Sample, changes: FloatArray) -> FloatArray:
    """Return `changes` (n, nt, nz, nx) of maps as they change a whitened remainder."""
    smooth = (at_compared_cells(change * sample.seen_mask, SMOOTHING_WIDTH) for change in changes)
    return np.stack([sample.weighted(one).astype(np.float32) for one in smooth])


def _chosen(regression: Regression) -> tuple[list[Cause], list[FloatArray], float]:
    """Return the chosen causes, the amounts of each, and the share that they close."""
    numbers: list[int] = []
    closed = 0.0
    while len(numbers) < MOST_TERMS:
        names = {regression.causes[number].name for number in numbers}
        scores = {
            number: regression.score([*numbers, number])
            for number, cause in enumerate(regression.causes)
            if cause.name not in names
        }
        best = min(scores, key=lambda number: scores[number], default=None)
        if best is None or not math.isfinite(scores[best]):
            break
        rows = regression.rows_of([*numbers, best])
        now = regression.held_out.closed(
            regression.held_out.left(rows, regression.fitted.solved(rows))
        )
        if now < closed + LEAST_GAIN * regression.causes[best].freedom:
            break
        numbers, closed = [*numbers, best], now
    if not numbers:
        return [], [], 0.0
    amounts = regression.fitted.solved(regression.rows_of(numbers))
    parts = regression.parts_of(numbers, amounts)
    return [regression.causes[number] for number in numbers], parts, closed


def _terms(causes: Sequence[Cause], amounts: Sequence[FloatArray]) -> Iterable[Term]:
    for cause, values in zip(causes, amounts, strict=True):
        yield Term(
            cause.name,
            cause.process.value,
            float(values[0]),
            cause.unit,
            cause.words(values.tolist()),
            cause.check,
            cause.place,
        )
