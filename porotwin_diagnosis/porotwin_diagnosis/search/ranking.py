"""By what fits are compared, and which of them go on."""

import math
from collections.abc import Sequence

import numpy as np

from porotwin_diagnosis.model.fit import Fit
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate

NOISE_DOUBT = 1.1
"""By how much the noise may be stronger than measured."""

EXPLAINED = 0.5
"""Excess below which a judged effect leaves nothing for a second one."""

NEARLY_CLOSED = 1.5
"""Excess of the best model below which it is worth to look more closely: with more pairs, and with
finer cells."""

NEAR = 1.5
"""Fits whose misfit is above this many times the best one's go no further (but the second)."""

ALIKE = 1.03
"""Fits whose misfit is within this factor of the last one that goes on go on with it."""

OCCAM = 1.08
"""Every parameter must lower the misfit by this factor to be preferred: a wrong effect with many
parameters takes up some of what the schemes do wrong."""


def beyond_noise(fit: Fit) -> tuple[float, ...]:
    """Return what a judged `fit` leaves beyond the noise, of the fitted and of the held-out part,
    in units of the share of a cell by which no front is known."""
    parts = zip((fit.fitted, fit.held_out), fit.noise, strict=True)
    return tuple(
        math.sqrt(max(all_of_it**2 - (NOISE_DOUBT * noise) ** 2, 0.0)) for all_of_it, noise in parts
    )


def normalised_misfit(fit: Fit) -> float:
    """Return what `fit` leaves `beyond_noise` of the part where it leaves more, as a multiple of
    what a model that is right may leave: of a viscosity, and of one that magnifies how rough the
    sand is, that is more."""
    allowance = max((EFFECTS[m.effect].misfit_allowance for m in fit.members), default=1.0)
    parts = zip(beyond_noise(fit), fit.fingering_amplification, strict=True)
    return (
        max(left / fingering_amplification for left, fingering_amplification in parts) / allowance
    )


def score(fit: Fit) -> float:
    """Return the misfit of fitted and held-out part together."""
    return overall(fit.fitted, fit.held_out)


def worse(fit: Fit) -> float:
    """Return the misfit of the part, fitted or held out, where `fit` leaves more: a wrong effect
    adapts to what it is fitted to, and fails in what it has not seen."""
    return max(fit.fitted, fit.held_out)


def overall(fitted: float, held_out: float) -> float:
    """Return the misfit of both parts together, of theirs."""
    return float(np.hypot(fitted, held_out) / np.sqrt(2.0))


def possible(fits: Sequence[Fit]) -> list[Fit]:
    """Return those of `fits` with which the model could run."""
    return [fit for fit in fits if fit.possible]


def near(fits: Sequence[Fit]) -> list[Fit]:
    """Return the fits near the best of `fits`, which are in order, and the second in any case."""
    if not fits:
        return []
    kept = [
        fit for index, fit in enumerate(fits) if index < 2 or score(fit) < NEAR * score(fits[0])
    ]
    return [fit for fit in fits if score(fit) <= ALIKE * score(kept[-1])]


def ranked(fits: Sequence[Fit]) -> list[Fit]:
    """Return the judged `fits`, the most plausible first, of what was fitted twice the better."""
    best: dict[frozenset[str], Fit] = {}
    for fit in sorted(fits, key=lambda fit: worse(fit) * OCCAM ** len(fit.scaled)):
        best.setdefault(labels(fit.members), fit)
    return list(best.values())


def distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return the first of the single `fits` of every effect and well."""
    best: dict[tuple[str, object], Fit] = {}
    for fit in fits:
        best.setdefault(kind(fit), fit)
    return list(best.values())


def kind(fit: Fit) -> tuple[str, object]:
    """Return the effect and well of a single effect's `fit`, variants of one effect being one."""
    member = fit.members[0]
    return member.effect, member.fixed.get('well')


def labels(members: Sequence[Candidate]) -> frozenset[str]:
    """Return what fits of the same `members`, in any order, have in common."""
    return frozenset(member.label for member in members)
