"""The smallest strength of each effect that would have been visible in a recording."""

import math
from typing import NamedTuple

import numpy as np

from porotwin_core.basis.errors import InputError
from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import Rig
from porotwin_diagnosis.data.sample import SMOOTHING_WIDTH
from porotwin_diagnosis.model.fitter import Fitter
from porotwin_diagnosis.model.library import library, nominal_parameters
from porotwin_diagnosis.thresholds import VISIBLE_CHANGE
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate

TRIAL_STEP = 1.0
"""Change of a scaled parameter for the measured response: it moves a front by about one cell."""


class Strength(NamedTuple):
    """The least deviation `value` [`unit`] of a `parameter` that would have been visible.

    `well` is the well where it shows best; empty if the effect belongs to none.
    """

    parameter: str
    value: float
    unit: str
    well: str = ''


class _Trial(NamedTuple):
    """A small amount of an effect: which parameter is tried, and its value without the effect."""

    number: int
    scaled: list[float]
    absent: float


def smallest_strengths(fitter: Fitter) -> dict[str, Strength]:
    """Return the smallest visible strength of each effect, by its name.

    A small amount of the effect changes the whitened residuals by r per cell with tracer (root mean
    square). Its strength times `VISIBLE_CHANGE` / r is just visible. Strengths are deviations from
    no effect (from 1 for a factor), or from the effect in the rig description. Of several
    parameters the first counts, of several wells the most visible one. An effect with a place is
    put in the middle of the rig. Effects that change nothing are left out.

    Raises:
        InputError: the model cannot run without effects.
    """
    base = fitter.residuals((), SMOOTHING_WIDTH)
    cells = max(sum(sample.tracer_cells for sample in fitter.samples), 1)
    found: dict[str, Strength] = {}
    for candidate in library(fitter.samples):
        trial = _trial(candidate, fitter.samples[0].rig)
        power = _response_power(fitter, base, candidate, trial)
        if power <= 0.0:
            continue
        parameter = candidate.parameters[trial.number]
        deviation = abs(parameter.value(trial.scaled[trial.number]) - trial.absent)
        least = deviation * VISIBLE_CHANGE / math.sqrt(power / cells)
        known = found.get(candidate.effect)
        if known is None or (known.parameter == parameter.name and least < known.value):
            well = str(candidate.fixed.get('well', ''))
            found[candidate.effect] = Strength(
                parameter.name, float(f'{least:.3g}'), parameter.unit, well
            )
    return found


def _response_power(
    fitter: Fitter, base: list[FloatArray], candidate: Candidate, trial: _Trial
) -> float:
    """Return the sum of squares of the change in residuals; 0 if the model cannot run."""
    try:
        changed = fitter.residuals((candidate.described(trial.scaled),), SMOOTHING_WIDTH)
    except InputError:
        return 0.0
    return sum(float(np.sum((a - b) ** 2)) for a, b in zip(base, changed, strict=True))


def _trial(candidate: Candidate, rig: Rig) -> _Trial:
    """Return a small amount of the effect `candidate`."""
    scaled = list(candidate.first)
    if EFFECTS[candidate.effect].has_place:
        scaled[-1] = TRIAL_STEP
        return _Trial(len(scaled) - 1, scaled, candidate.parameters[-1].neutral)
    parameter = candidate.parameters[0]
    if nominal_parameters(rig, candidate.effect) is not None:
        nominal = parameter.value(scaled[0])
        scaled[0] += TRIAL_STEP
        return _Trial(0, scaled, nominal)
    if not parameter.is_never_absent:
        scaled[0] = TRIAL_STEP
    return _Trial(0, scaled, parameter.absent)
