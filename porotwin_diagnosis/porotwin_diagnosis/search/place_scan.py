"""A scan for the place of a leak or a zone, by coarse simulations at many places.

While such an effect is absent, its residual has no gradient with respect to its place. Therefore a
trial effect is put at every place of a coarse grid in turn. Its response b, the change that it
makes in the maps, is compared with the residual r of the model. With its strength multiplied by k,
the trial explains 2 k (b.r) - k^2 (b.b) of r.r. The best k is (b.r) / (b.b), within the factors
that the effect allows: far beyond them responses are not linear, and far places explain as much.
"""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.ndimage import gaussian_filter

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray, Grid, conservative_resample
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.model.forward import Forward
from porotwin_diagnosis.model.library import search_context
from porotwin_diagnosis.thresholds import BEAM
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate, PlaceSearch
from porotwin_solver.model.simulation import simulate

SCAN_COLUMNS, FEWEST_ROWS = 46, 8
"""Columns of the coarse grid, and its fewest rows: about four cells per distance of two places."""

SCAN_FRAMES = 8
"""Frames that are compared, from early to late ones, and most onsets; they bound the time."""

SCAN_SMOOTHING = 1.0
"""Width [coarse cells] of the smoothing of maps, which suppresses noise and smearing."""

PLACE_DISTANCE = 0.09
"""Distance of neighbouring places as a share of the rig's longer side, one and a half radii of a
trial zone."""

LEAST_DISTANCE = 1.5
"""Least distance of two starts in units of the distance of places: neighbours and diagonal
neighbours of a better start lead to the same fit."""


@dataclass(frozen=True)
class CoarseRecording:
    """One recording on the coarse grid.

    Attributes:
        sample: the recording.
        grid: the coarse grid.
        times: times of the compared frames [s], (nt,).
        crew: runs the simulations; None: the thread that wants one does.
    """

    sample: Sample
    grid: Grid
    times: FloatArray
    crew: Executor | None

    def simulated(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return the smoothed simulated maps with `effects`, (nt, nz, nx) [-]."""
        simulation = partial(
            simulate,
            self.sample.rig,
            self.sample.schedule,
            self.times,
            grid=self.grid,
            preset='fast',
            effects=effects,
            initial=self.sample.initial_on(self.grid),
            start=self.sample.model_start,
        )
        maps = simulation() if self.crew is None else self.crew.submit(simulation).result()
        return _smoothed(maps)


@dataclass(frozen=True)
class ScanComparison:
    """The residual of the model without effects, and the maps that it simulates.

    Attributes:
        recording: the recording on the coarse grid.
        residual: smoothed residual (nt, nz, nx) [-].
        simulated: smoothed simulated maps (nt, nz, nx) [-] without effects.
    """

    recording: CoarseRecording
    residual: FloatArray
    simulated: FloatArray

    def response(self, effects: Sequence[EffectDescription]) -> FloatArray:
        """Return the change (nt, nz, nx) [-] that `effects` make."""
        return self.recording.simulated(effects) - self.simulated


def promising_starts(
    forwards: Sequence[Forward],
    effect: str,
    *,
    pool: Executor | None = None,
) -> list[Candidate]:
    """Return the most promising starts of a fit of an effect with a place, the best first.

    Args:
        forwards: one forward model per recording.
        effect: the name of an effect with a place.
        pool: compares the simulations; None for one at a time.

    Raises:
        InputError: no pump ever runs, the rig is closed, or the model cannot run without effects.
    """
    comparisons = [compared(forward) for forward in forwards]
    sample = comparisons[0].recording.sample
    trials = trials_of(sample, effect)
    run = map if pool is None else pool.map

    def response(effects: Sequence[EffectDescription]) -> FloatArray:
        return np.concatenate([part.response(effects).ravel() for part in comparisons])

    residual = np.concatenate([part.residual.ravel() for part in comparisons])

    def gain(trial: Candidate) -> tuple[float, float]:
        """Return the explained part of the residual's square, and the factor on the strength."""
        own = response((trial.described(trial.first),))
        return explained_part(own, residual, _place_search(effect).strength_factors)

    return _best_apart(trials, list(run(gain, trials)), _place_distance(sample))


def explained_part(
    response: FloatArray, residual: FloatArray, factors: tuple[float, float]
) -> tuple[float, float]:
    """Return the part of the square of `residual` that `response` explains, and the best factor.

    Both are (n,). The factor on the response lies within `factors`; it is 0 for a response of the
    opposite sign.
    """
    projected, norm = float(response @ residual), float(response @ response)
    if norm <= 0.0 or projected <= 0.0:
        return 0.0, 0.0
    factor = float(np.clip(projected / norm, *factors))
    return 2.0 * factor * projected - factor**2 * norm, factor


def compared(forward: Forward) -> ScanComparison:
    """Return the comparison of a recording with the model without effects."""
    sample = forward.sample
    columns = min(SCAN_COLUMNS, sample.grid.nx)
    rows = max(FEWEST_ROWS, round(columns * sample.grid.nz / sample.grid.nx))
    grid = sample.rig.grid(columns, rows)
    frames = np.unique(np.linspace(0, sample.fitted_frames - 1, SCAN_FRAMES).round().astype(int))
    expected = sample.noise.expected(forward.maps(())[frames])
    residual = (sample.observed_or_zero[frames] - expected) * sample.seen_mask[frames]
    coarse = np.stack([conservative_resample(frame, grid.shape) for frame in residual])
    recording = CoarseRecording(sample, grid, sample.times[frames], forward.crew)
    return ScanComparison(recording, _smoothed(coarse), recording.simulated(()))


def _smoothed(maps: FloatArray) -> FloatArray:
    return gaussian_filter(maps, (0.0, SCAN_SMOOTHING, SCAN_SMOOTHING))


def _best_apart(
    trials: Sequence[Candidate], gains: Sequence[tuple[float, float]], distance: float
) -> list[Candidate]:
    """Return the trials with the largest gains that lie apart from each other.

    `gains` holds the explained part and the factor on the strength of every trial; a trial that
    would need the opposite sign is left out. `distance` is the one of neighbouring places [m].
    """
    best: list[Candidate] = []
    for index in np.argsort([-explained for explained, _ in gains]):
        trial, factor = trials[index], gains[index][1]
        if factor <= 0.0:
            continue
        if all(_distance(trial, other) > LEAST_DISTANCE * distance for other in best):
            best.append(with_strength(trial, factor))
        if len(best) == BEAM:
            break
    return best


def _place_distance(sample: Sample) -> float:
    """Return the distance of neighbouring places [m]."""
    return PLACE_DISTANCE * max(sample.rig.width_m, sample.rig.height_m)


def _places(sample: Sample) -> list[tuple[float, float]]:
    """Return the places (x, z) [m] that are tried."""
    rig, distance = sample.rig, _place_distance(sample)
    columns, rows = round(rig.width_m / distance), round(rig.height_m / distance)
    return [
        ((i + 0.5) * rig.width_m / columns, (j + 0.5) * rig.height_m / rows)
        for i in range(columns)
        for j in range(rows)
    ]


def trials_of(sample: Sample, effect: str) -> list[Candidate]:
    """Return the candidates of `effect` that are tried, at all places.

    Raises:
        InputError: nothing sets the scale of the effect, such as pumps that never run.
    """
    return [trial for place in _places(sample) for trial in trials_at(sample, effect, place)]


def trials_at(sample: Sample, effect: str, place: tuple[float, float]) -> Sequence[Candidate]:
    """Return the candidates of `effect` that are tried at one `place` (x, z) [m].

    Raises:
        InputError: as `trials_of`.
    """
    return _place_search(effect).trials(search_context([sample], sample), place)


def sized_trials_at(sample: Sample, effect: str, place: tuple[float, float]) -> Sequence[Candidate]:
    """Return candidates of `effect` of several sizes at one `place` (x, z) [m].

    The result is empty if the rig cannot have the effect: a rig that is closed on all sides has no
    leak.
    """
    search = _place_search(effect)
    try:
        return (search.sized_trials or search.trials)(search_context([sample], sample), place)
    except InputError:
        return []


def _place_search(name: str) -> PlaceSearch:
    search = EFFECTS[name].places
    if search is None:
        raise InputError(f'{name}: has no place to be found')
    return search


def _distance(one: Candidate, other: Candidate) -> float:
    """Return the distance [m] of the places of two trials."""
    (x, z), (other_x, other_z) = (
        [parameter.neutral for parameter in trial.parameters[:2]] for trial in (one, other)
    )
    return math.hypot(x - other_x, z - other_z)


def with_strength(trial: Candidate, factor: float) -> Candidate:
    """Return the start at `trial` with its strength, the last parameter, multiplied by `factor`."""
    start = list(trial.first)
    limits = _place_search(trial.effect).strength_factors
    start[-1] *= float(np.clip(factor, *limits))
    return Candidate(trial.effect, trial.parameters, starts=(tuple(start),))
