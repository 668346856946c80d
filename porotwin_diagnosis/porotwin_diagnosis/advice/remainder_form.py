"""The form of an unexplained gap, in the words of a physicist.

The remainder o - c between the observed maps and a model that runs from the start is regressed on
patterns, each the first-order change that one simple cause makes in the predicted map c. With the
time t since the start and the duration T of the recording:

| pattern | cause | kind |
| --- | --- | --- |
| -c, -c t / T | a paler plume; one that fades with time | camera, storage |
| 4 c (1 - c) | a bent response | camera |
| glow at a place | light that is no tracer | camera |
| -grad c, -grad c t / T | a displaced picture; tracer that drifts | camera, transport |
| -dc/dt, -dc/dt t | a late clock; delay that grows | camera, storage |
| -(1 - c) dc/dt t | delay of pale tracer | storage |
| laplacian c t | fronts that spread | transport |
| -(x - x0) dc/dx t / T, likewise z | a flow that prefers a direction | transport |
| -(r - r0) / r^2 . grad c t / T, t^2 / T^2 | water that enters at r0; ever more of it | source |

The fitted frames choose at most `MOST_TERMS` patterns, one after the other. In the held-out frames
each pattern must close at least `LEAST_GAIN` of the remainder, and all together `LEAST_CLOSED`. The
remainder comes from a free run, because one-step residuals of noisy maps are biased.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Literal

import numpy as np

from porotwin_core.grid import FloatArray
from porotwin_core.units import to_ml_h
from porotwin_diagnosis.data.noise import blurred
from porotwin_diagnosis.data.sample import STRIDE, Sample
from porotwin_diagnosis.data.shared_errors import derivatives

Kind = Literal['source', 'transport', 'storage', 'camera']

MOST_TERMS = 3
"""Largest number of terms; more describe noise."""

LEAST_CLOSED = 0.25
"""Share of the held-out remainder below which a description is refused."""

LEAST_GAIN = 0.05
"""Share of the held-out remainder that a further term must close."""

PATTERN_WIDTH = 2.0
"""Width [cells] over which the model is smoothed before it is differentiated. Fronts that lie a few
cells apart have no gradient at the resolution of the maps."""

PLACES = (16, 10)
"""Columns and rows of places that are tried for a source or a glow at first."""

FINER_PLACES = np.linspace(-0.5, 0.5, 4)
"""Places that are tried around the best one, relative to the distance of the first ones."""

GLOW_RADIUS = 0.06
"""Radius of a glow relative to the width of the rig. It is not fitted: a smaller glow is stated too
faint, and its strength times the square of the radius is right."""

CORE_CELLS = 4.0
"""Cells around a source within which the displacement is that of the edge: there it is no small
change."""


@dataclass(frozen=True)
class Term:
    """One pattern of the remainder.

    Attributes:
        name: short name of the pattern.
        kind: where in the experiment its cause lies.
        amount: fitted factor of the pattern.
        unit: unit of the amount.
        words: the cause with its size, in words.
        place: (x, z) [m], or None for a pattern of the whole rig.
    """

    name: str
    kind: Kind
    amount: float
    unit: str
    words: str
    place: tuple[float, float] | None = None


@dataclass(frozen=True)
class RemainderForm:
    """A description of a remainder.

    Attributes:
        terms: the patterns, the strongest first; empty if no pattern holds.
        closed: share of the held-out remainder that they close [-].
    """

    terms: tuple[Term, ...]
    closed: float

    @property
    def kind(self) -> Kind | None:
        """Kind of the strongest pattern; None if no pattern holds."""
        return self.terms[0].kind if self.terms else None


@dataclass(frozen=True)
class Pattern:
    """A candidate for a term: one or two fields that are fitted together.

    Attributes:
        name: short name.
        kind: where in the experiment its cause lies.
        unit: unit of the factors.
        fields: what a factor of 1 changes in the maps at the compared cells, (n, nt, nz', nx').
        place: (x, z) [m], or None.
    """

    name: str
    kind: Kind
    unit: str
    fields: FloatArray
    place: tuple[float, float] | None = None


class Patterns:
    """All patterns for the remainder of one sample.

    Args:
        sample: the frames.
        predicted: maps of the model (nt, nz, nx) [-].
    """

    def __init__(self, sample: Sample, predicted: FloatArray) -> None:
        grid = sample.grid
        smooth = blurred(np.clip(predicted, 0.0, 1.0), PATTERN_WIDTH)
        up, right, bend = derivatives(smooth, grid)
        self._c, self._up, self._right, self._bend = (
            np.asarray(part)[:, ::STRIDE, ::STRIDE] for part in (smooth, up, right, bend)
        )
        self._x, self._z = (part[::STRIDE, ::STRIDE] for part in np.meshgrid(grid.x, grid.z))
        self._later = np.gradient(self._c, sample.times, axis=0)
        self._since = np.maximum(sample.times - sample.model_start, 0.0)[:, None, None]
        self._t = self._since / max(sample.end - sample.model_start, 1e-9)
        self._core = (CORE_CELLS * grid.dx) ** 2
        self._width, self._height = grid.width, grid.height

    def everywhere(self) -> Iterator[Pattern]:
        """Yield the patterns of the whole rig."""
        c, t, since = self._c, self._t, self._since
        weights = c.mean(axis=0) + 1e-12
        x, z = (part - float(np.average(part, weights=weights)) for part in (self._x, self._z))

        def pattern(name: str, kind: Kind, unit: str, *fields: FloatArray) -> Pattern:
            return Pattern(name, kind, unit, np.stack(fields))

        yield pattern('paler', 'camera', '-', -c)
        yield pattern('fading', 'storage', '-', -c * t)
        yield pattern('bent response', 'camera', '-', 4.0 * c * (1.0 - c))
        yield pattern('displaced', 'camera', 'm', -self._right, -self._up)
        yield pattern('drifting', 'transport', 'm', -self._right * t, -self._up * t)
        yield pattern('late', 'camera', 's', -self._later)
        yield pattern('delayed', 'storage', '-', -self._later * since)
        yield pattern('pale tracer delayed', 'storage', '-', -self._later * since * (1.0 - c))
        yield pattern('spreading', 'transport', 'm2/s', self._bend * since)
        directed = (-self._right * x * t, -self._up * z * t)
        yield pattern('preferred direction', 'transport', '-', *directed)

    def at_places(self) -> Iterator[Pattern]:
        """Yield the patterns of a place, at places all over the rig."""
        columns, rows = PLACES
        for x in (np.arange(columns) + 0.5) * self._width / columns:
            for z in (np.arange(rows) + 0.5) * self._height / rows:
                yield from self._at((float(x), float(z)))

    def around(self, found: Pattern) -> Iterator[Pattern]:
        """Yield the pattern `found` at places around its own place; nothing without a place."""
        if found.place is None:
            return
        for right in FINER_PLACES * self._width / PLACES[0]:
            for up in FINER_PLACES * self._height / PLACES[1]:
                place = (found.place[0] + float(right), found.place[1] + float(up))
                yield from (one for one in self._at(place) if one.name == found.name)

    def _at(self, place: tuple[float, float]) -> Iterator[Pattern]:
        x, z = self._x - place[0], self._z - place[1]
        square = x**2 + z**2
        outward = -(self._right * x + self._up * z) / (square + self._core)
        yield Pattern('source', 'source', 'm2', (outward * self._t)[None], place)
        yield Pattern('growing source', 'source', 'm2', (outward * self._t**2)[None], place)
        glow = np.exp(-0.5 * square / (GLOW_RADIUS * self._width) ** 2)
        yield Pattern('glow', 'camera', '-', (glow * np.ones_like(self._t))[None], place)


def describe_remainder(sample: Sample, predicted: FloatArray) -> RemainderForm:
    """Return the form of the remainder of `sample` beside the model `predicted` (nt, nz, nx)."""
    remainder = sample.whitened(predicted)
    known = Patterns(sample, predicted)
    fitted = sample.fitted_frames
    chosen: list[Pattern] = []
    columns: FloatArray = np.zeros((0, *remainder.shape))
    factors: FloatArray = np.zeros(0)
    closed = 0.0
    while len(chosen) < MOST_TERMS:
        left = (remainder - np.tensordot(factors, columns, axes=1))[:fitted]
        names = {pattern.name for pattern in chosen}
        best = _best(sample, left, chain(known.everywhere(), known.at_places()), names)
        if best is None:
            break
        best = _best(sample, left, (best, *known.around(best)), names) or best
        trial = np.concatenate([columns, _whitened(sample, best.fields)])
        found = _solved(remainder[:fitted], trial[:, :fitted])
        now = _closed(remainder[fitted:], trial[:, fitted:], found)
        if now < closed + LEAST_GAIN:
            break
        chosen, columns, factors, closed = [*chosen, best], trial, found, now
    if closed < LEAST_CLOSED:
        return RemainderForm((), closed)
    return RemainderForm(tuple(_terms(sample, chosen, factors)), closed)


def _best(
    sample: Sample, left: FloatArray, candidates: Iterable[Pattern], without: Collection[str]
) -> Pattern | None:
    """Return the candidate that explains most of the fitted frames `left`; None if none does.

    Candidates whose name is in `without` are left out.
    """
    best, most = None, 0.0
    for pattern in candidates:
        if pattern.name in without:
            continue
        gain = _gain(left, _whitened(sample, pattern.fields[:, : len(left)]))
        if gain > most:
            best, most = pattern, gain
    return best


def _whitened(sample: Sample, fields: FloatArray) -> FloatArray:
    """Return `fields` (n, nt, nz', nx') as they change a whitened residual, of the same shape."""
    return np.stack([sample.weighted(field) for field in fields])


def _gain(left: FloatArray, columns: FloatArray) -> float:
    """Return the decrease of the sum of squares of `left` that `columns` allow."""
    factors = _solved(left, columns)
    after = left - np.tensordot(factors, columns, axes=1)
    return float(np.sum(left**2) - np.sum(after**2))


def _solved(left: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the least squares factors (n,) of `columns` (n, ...) for `left`."""
    flat = columns.reshape(len(columns), -1)
    normal = flat @ flat.T
    ridge = 1e-9 * max(float(np.trace(normal)), 1e-30) * np.eye(len(flat))
    return np.linalg.solve(normal + ridge, flat @ left.ravel())


def _closed(left: FloatArray, columns: FloatArray, factors: FloatArray) -> float:
    after = left - np.tensordot(factors, columns, axes=1)
    return 1.0 - float(np.linalg.norm(after) / max(float(np.linalg.norm(left)), 1e-12))


def _terms(sample: Sample, chosen: Sequence[Pattern], factors: FloatArray) -> Iterator[Term]:
    start = 0
    for pattern in chosen:
        values = factors[start : start + len(pattern.fields)]
        start += len(pattern.fields)
        largest = float(values[np.argmax(np.abs(values))])
        yield Term(
            pattern.name,
            pattern.kind,
            largest,
            pattern.unit,
            _words(sample, pattern, values),
            pattern.place,
        )


def _words(sample: Sample, pattern: Pattern, values: FloatArray) -> str:
    """Return the cause that `pattern` stands for, with its size."""
    first, minutes = float(values[0]), (sample.end - sample.model_start) / 60
    at = '' if pattern.place is None else ' near x = {:.2f} m, z = {:.2f} m'.format(*pattern.place)
    if pattern.name in ('displaced', 'drifting', 'preferred direction'):
        across, up = (float(value) for value in values)
    if pattern.name == 'displaced':
        return f'the picture is displaced by {_directed(across, up)}'
    if pattern.name == 'drifting':
        return f'the tracer drifts by {_directed(across, up)} within {minutes:.0f} min'
    if pattern.name == 'preferred direction':
        return (
            f'the plume is stretched by {100 * across:.1f} % across and {100 * up:.1f} % up, as by '
            'a flow that prefers a direction'
        )
    if pattern.name in ('source', 'growing source'):
        more = ', more and more with time' if pattern.name == 'growing source' else ''
        rate = to_ml_h(_source_rate(sample, first))
        gained = 'enters' if rate > 0 else 'is missing'
        return f'water {gained}{at}, {abs(rate):.2g} ml/h in the mean{more}'
    less, size = ('less' if first > 0 else 'more'), abs(first)
    return {
        'paler': f'the plume is {100 * size:.1f} % {"paler" if first > 0 else "darker"} throughout',
        'fading': f'{100 * size:.1f} % {less} tracer is seen after {minutes:.0f} min',
        'bent response': f'half of the stock is seen {first:+.3f} off: the response is bent',
        'late': f'everything is {abs(first):.0f} s {"late" if first > 0 else "early"}',
        'delayed': f'fronts move {100 * size:.1f} % {"slower" if first > 0 else "faster"}',
        'pale tracer delayed': f'pale tracer moves {100 * size:.1f} % '
        f'{"slower" if first > 0 else "faster"} than stock',
        'spreading': f'fronts {"spread" if first > 0 else "are sharper"} as by a diffusion of '
        f'{size:.1e} m2/s',
        'glow': f'a signal of {first:+.3f} that is no tracer, if it is '
        f'{1e3 * GLOW_RADIUS * sample.rig.width_m:.0f} mm wide{at}',
    }[pattern.name]


def _source_rate(sample: Sample, factor: float) -> float:
    """Return the mean rate [m^3/s] of a source whose displacement at the distance r is factor / r.

    The area 2 pi factor is filled within the recording.
    """
    rig = sample.rig
    pores = rig.pore_volume / (rig.width_m * rig.height_m)
    return 2.0 * np.pi * factor * pores / max(sample.end - sample.model_start, 1e-9)


def _directed(across: float, up: float) -> str:
    """Return a displacement [m] in words."""
    sides = ((across, 'right', 'left'), (up, 'up', 'down'))
    return ' and '.join(
        f'{1e3 * abs(value):.1f} mm {plus if value > 0 else minus}' for value, plus, minus in sides
    )
