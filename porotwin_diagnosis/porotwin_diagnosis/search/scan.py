"""Where a local effect may sit: coarse simulations of one at many places, against the residual.

A zone or a leak has no gradient with respect to its place as long as it is absent. So it is put
everywhere in turn on a coarse grid; what changes there is compared with the residual of the model
at the recording's resolution, averaged to the same cells.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.linalg import orth
from scipy.ndimage import gaussian_filter

from porotwin_core.errors import InputError
from porotwin_core.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.fit import Fit, described
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import search_context
from porotwin_solver.effects import effect as effect_named
from porotwin_solver.effects.definition.candidate import Candidate, PlaceSearch
from porotwin_solver.simulation import simulate

COLUMNS = 46
"""Coarse cells across the rig."""

COARSE_FRAMES = 8
"""Frames that are compared."""

SPACING = 0.09
"""Distance of the places tried, as a share of the rig's longer side."""

KEPT = 3
"""Starts that are worth a fit."""


@dataclass(frozen=True)
class _Coarse:
    """One recording on coarse cells: the times compared, the residual and the unperturbed run."""

    sample: Sample
    grid: Grid
    times: FloatArray
    residual: FloatArray
    base: FloatArray

    def change(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return what `effects` change, (nt, nz, nx), where they take the place of those given."""
        return self.smoothed(self._run(effects)) - self.base

    def _run(self, effects: Sequence[EffectDescription]) -> FloatArray:
        return simulate(
            self.sample.rig,
            self.sample.schedule,
            self.times,
            grid=self.grid,
            preset='fast',
            effects=effects,
            initial=self.sample.initial_on(self.grid),
            start=self.sample.model_start,
        )

    def smoothed(self, maps: FloatArray) -> FloatArray:
        return gaussian_filter(maps, (0.0, 1.0, 1.0))


def _coarse(forward: Forward, given: tuple[EffectDescription, ...]) -> _Coarse:
    sample = forward.sample
    columns = min(COLUMNS, sample.grid.nx)
    grid = sample.rig.grid(columns, max(8, round(columns * sample.grid.nz / sample.grid.nx)))
    frames = np.unique(np.linspace(0, sample.fitted - 1, COARSE_FRAMES).round().astype(int))
    predicted = forward.maps(given)[frames]
    expected = sample.noise.expected(predicted)
    residual = (sample.filled[frames] - expected) * sample.known[frames]
    coarse = np.stack([conservative_resample(frame, grid.shape) for frame in residual])
    half = _Coarse(sample, grid, sample.times[frames], coarse, np.zeros(1))
    return _Coarse(
        sample, grid, sample.times[frames], half.smoothed(coarse), half.smoothed(half._run(given))
    )


def starts(
    forwards: Sequence[Forward],
    effect: str,
    *,
    beside: Fit | None = None,
    pool: ThreadPoolExecutor | None = None,
) -> list[Candidate]:
    """Return the most promising starts of `effect`, a leak or a heterogeneity.

    Where there is another effect `beside` it, its parameters may adapt: only what they cannot
    change, to first order, says where the place is.
    """
    given = beside.effects if beside else ()
    coarse = [_coarse(forward, given) for forward in forwards]
    tried = _trials(coarse[0].sample, effect)
    run = map if pool is None else pool.map

    def change(effects: Sequence[EffectDescription]) -> FloatArray:
        return np.concatenate([part.change(effects).ravel() for part in coarse])

    residual = np.concatenate([part.residual.ravel() for part in coarse])
    adapting = np.zeros((len(residual), 0))
    if beside is not None:
        adapting = orth(np.stack(list(run(change, _turned(beside))), axis=1))

    def gain(candidate: Candidate) -> tuple[float, float]:
        response = change((*given, candidate.described(candidate.first)))
        response -= adapting @ (adapting.T @ response)
        projected, norm = float(response @ residual), float(response @ response)
        return (projected**2 / norm, projected / norm) if norm > 0 else (0.0, 0.0)

    gains = list(run(gain, tried))
    order = np.argsort([-value for value, _ in gains])
    kept: list[Candidate] = []
    for index in order:
        candidate, amplitude = tried[index], gains[index][1]
        if amplitude <= 0.0:
            continue
        if all(_distance(candidate, other) > 1.5 * _spacing(coarse[0].sample) for other in kept):
            kept.append(_scaled(candidate, effect, amplitude))
        if len(kept) == KEPT:
            break
    return kept


def _turned(fit: Fit) -> list[tuple[EffectDescription, ...]]:
    """Return the effects of `fit` with each of its parameters moved by one step."""
    parameters = [parameter for member in fit.members for parameter in member.parameters]
    turned = []
    for index, parameter in enumerate(parameters):
        scaled = fit.scaled.copy()
        scaled[index] += 1.0 if scaled[index] + 1.0 <= parameter.range[1] else -1.0
        turned.append(described(fit.members, scaled))
    return turned


def _spacing(sample: Sample) -> float:
    return SPACING * max(sample.rig.width_m, sample.rig.height_m)


def _places(sample: Sample) -> list[tuple[float, float]]:
    rig, spacing = sample.rig, _spacing(sample)
    columns, rows = round(rig.width_m / spacing), round(rig.height_m / spacing)
    return [
        ((i + 0.5) * rig.width_m / columns, (j + 0.5) * rig.height_m / rows)
        for i in range(columns)
        for j in range(rows)
    ]


def _trials(sample: Sample, effect: str) -> list[Candidate]:
    """Return the candidates of `effect` that are tried, at all places."""
    context, search = search_context([sample], sample), _place_search(effect)
    return [trial for place in _places(sample) for trial in search.trials(context, place)]


def _place_search(effect: str) -> PlaceSearch:
    search = effect_named(effect).places
    if search is None:
        raise InputError(f'{effect}: has no place to be found')
    return search


def _distance(one: Candidate, other: Candidate) -> float:
    (x, z), (other_x, other_z) = (
        [parameter.neutral for parameter in candidate.parameters[:2]] for candidate in (one, other)
    )
    return math.hypot(x - other_x, z - other_z)


def _scaled(candidate: Candidate, effect: str, amplitude: float) -> Candidate:
    """Return `candidate` whose strength starts at what the projection asks for, within reason."""
    start = list(candidate.first)
    start[-1] *= float(np.clip(amplitude, *_place_search(effect).strength_factors))
    return Candidate(candidate.effect, candidate.parameters, starts=(tuple(start),))
