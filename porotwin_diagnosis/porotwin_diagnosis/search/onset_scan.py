"""Effects that begin during a recording: a scan of their onsets, and fits from the best ones.

The residual has no gradient by the onset of an effect that is absent. So a trial begins at many
times in turn. Its responses A, a column per parameter, explain the part h.G^-1.h of the square of
the residual r, with G = A^T A and h = A^T r, and G^-1 h are the parameters of the start.

The onset of an effect of the rig is then fitted like any parameter. The camera shows its effects at
once, so that only the photographs on both sides of the onset count; it lies midway between them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.model.effect_parameter import SINCE
from porotwin_core.model.fitted_effect import FitParameter
from porotwin_diagnosis.data.sample import COARSE_SMOOTHING_WIDTH, Sample
from porotwin_diagnosis.model.effect_traits import needs_simulation
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.levels import Levels
from porotwin_diagnosis.search.place_scan import SCAN_FRAMES
from porotwin_diagnosis.search.ranking import feasible, score
from porotwin_diagnosis.thresholds import WIDE_BEAM
from porotwin_solver.effects.definition.candidate import Candidate

VARIANT = 'from a time on'
"""Variant of the candidates with an onset, in words."""


class _Start(NamedTuple):
    """A candidate with its onset, and the part of the squared residual that it explains [-]."""

    explained: float
    candidate: Candidate


def fits_with_onsets(levels: Levels, candidates: Sequence[Candidate]) -> list[Fit]:
    """Return fits of `candidates` from their best onsets, on coarse cells, the best score first.

    Only one recording has onsets: several ones together have no common time.
    """
    if len(levels.samples) > 1 or not candidates:
        return []
    here = levels.screening.residuals((), COARSE_SMOOTHING_WIDTH, fitted_only=True)[0]
    starts = levels.side_by_side(lambda one: _best_start(levels, here, one), candidates)
    best = sorted(starts, key=lambda start: -start.explained)[:WIDE_BEAM]
    fits = levels.side_by_side(lambda start: levels.screening.fit((start.candidate,)), best)
    return sorted(feasible(fits), key=score)


def begun(sample: Sample, candidate: Candidate, time: float) -> Candidate:
    """Return `candidate` with the onset `time` [s]; one of the camera keeps it."""
    if not needs_simulation(candidate.effect):
        return replace(candidate, fixed={**candidate.fixed, SINCE: time}, variant=VARIANT)
    last = float(sample.times[sample.fitted_frames - 1])
    since = FitParameter(SINCE, 's', 0.0, 0.01 * sample.duration, 0.0, last)
    start = (*candidate.first, since.scaled(time))
    parameters = (*candidate.parameters, since)
    return replace(candidate, parameters=parameters, starts=(start,), variant=VARIANT)


def _best_start(levels: Levels, here: FloatArray, candidate: Candidate) -> _Start:
    """Return the onset of `candidate` that explains most of the residual `here` (nt, nz', nx')."""
    (sample,) = levels.screening.samples
    times = sample.times[: sample.fitted_frames]
    onsets = 0.5 * (times[1:] + times[:-1])
    if needs_simulation(candidate.effect):  # a fit moves the onset on
        onsets = onsets[:: math.ceil(len(onsets) / SCAN_FRAMES)]
    starts = [_start(levels, here, candidate, float(time)) for time in onsets]
    return max(starts, key=lambda start: start.explained)


def _start(levels: Levels, here: FloatArray, candidate: Candidate, time: float) -> _Start:
    """Return the start that the responses at one onset give."""
    (sample,) = levels.screening.samples
    one, count = begun(sample, candidate, time), len(candidate.parameters)
    columns = [_response(levels, here, one, number) for number in range(count)]
    gram = np.array([[np.vdot(a, b) for b in columns] for a in columns])
    moments = np.array([np.vdot(column, here) for column in columns])
    amounts = np.linalg.lstsq(gram, moments)[0]
    start = [
        float(np.clip(first + amount, *parameter.range))
        for first, amount, parameter in zip(one.first, amounts, one.parameters, strict=False)
    ]
    moved = replace(one, starts=((*start, *one.first[count:]),))
    return _Start(float(moments @ amounts), moved)


def _response(levels: Levels, here: FloatArray, candidate: Candidate, number: int) -> FloatArray:
    """Return the change of the residual by one step of a parameter; 0 if the model cannot run."""
    moved = list(candidate.first)
    moved[number] += 1.0
    try:
        effects = (candidate.described(moved),)
        seen = levels.screening.residuals(effects, COARSE_SMOOTHING_WIDTH, fitted_only=True)[0]
    except InputError:
        return np.zeros_like(here)
    return here - seen
