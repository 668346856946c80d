"""The result of a fit: effects, their parameters, and the remaining misfit."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import EffectDescription
from porotwin_solver.effects.definition.candidate import Candidate


class MemberParameters(NamedTuple):
    """One effect of a fit: its scaled parameters [-] and their standard deviations, (p,) each."""

    candidate: Candidate
    scaled: FloatArray
    deviations: FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """Effects that were fitted together, or the model without effects (no members).

    Attributes:
        members: the fitted effects.
        scaled_parameters: scaled parameters of all members in a row, (p,).
        fitted_misfit: misfit [-] of the fitted frames (see `data.misfit`).
        held_out_misfit: misfit [-] of the held-out frames.
        fitted_error: relative L2 error [-] of the fitted maps.
        held_out_error: relative L2 error [-] of the held-out maps.
        covariance: covariance of the scaled parameters, (p, p); zero until it is computed.
        noise_misfit: misfit [-] that the noise alone would cause, fitted and held out.
        expected_noise: the same before the noise was bounded (see `search.noise_bound`).
        unshared_misfit: misfit [-] if the errors that all maps share were zero, fitted and held
            out; zero if the recording states no such errors.
        described: names of the effects that rig.yaml describes; the model has them in any case.
        held_out_parameters: scaled parameters (p,) with which the held-out frames are judged (see
            `fitter.Fitter.evaluate`); None for the fitted ones.
    """

    members: tuple[Candidate, ...]
    scaled_parameters: FloatArray
    fitted_misfit: float
    held_out_misfit: float
    fitted_error: float
    held_out_error: float
    covariance: FloatArray
    noise_misfit: tuple[float, float] = (0.0, 0.0)
    expected_noise: tuple[float, float] = (math.inf, math.inf)
    unshared_misfit: tuple[float, float] = (0.0, 0.0)
    described: tuple[str, ...] = ()
    held_out_parameters: FloatArray | None = None

    @property
    def is_feasible(self) -> bool:
        """Whether the model could run with these effects."""
        return math.isfinite(self.fitted_misfit)

    @property
    def label(self) -> str:
        """The labels of the members, joined by ` + `; `none` without members."""
        return ' + '.join(member.label for member in self.members) or 'none'

    @property
    def effects(self) -> tuple[EffectDescription, ...]:
        """The effects with their fitted parameters."""
        return effects_at(self.members, self.scaled_parameters)

    @property
    def member_parameters(self) -> tuple[MemberParameters, ...]:
        """The members with their own parameters and standard deviations."""
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return tuple(
            MemberParameters(member, self.scaled_parameters[part], deviations[part])
            for member, part in member_slices(self.members)
        )


def with_noise_share(fit: Fit, share: float) -> Fit:
    """Return `fit` with this `share` of its expected noise. The noise of the fit does not grow."""
    kinds = zip(fit.noise_misfit, fit.expected_noise, strict=True)
    fitted, held_out = (min(noise, share * expected) for noise, expected in kinds)
    return replace(fit, noise_misfit=(fitted, held_out))


def infeasible_fit(members: Sequence[Candidate], scaled_parameters: FloatArray) -> Fit:
    """Return an infeasible fit of `members` at `scaled_parameters` (p,).

    The model cannot run with these effects; the misfits and errors are infinite.
    """
    size = len(scaled_parameters)
    scaled = np.array(scaled_parameters, dtype=float)
    return Fit(tuple(members), scaled, *(math.inf,) * 4, np.zeros((size, size)))


def effects_at(
    members: Sequence[Candidate], scaled_parameters: FloatArray
) -> tuple[EffectDescription, ...]:
    """Return the effects of `members` at `scaled_parameters`, (p,), all members in a row."""
    return tuple(
        member.described(scaled_parameters[part].tolist())
        for member, part in member_slices(members)
    )


def member_slices(members: Sequence[Candidate]) -> Iterator[tuple[Candidate, slice]]:
    """Yield each of `members` with the slice of its own parameters in a row of all."""
    start = 0
    for member in members:
        end = start + len(member.parameters)
        yield member, slice(start, end)
        start = end
