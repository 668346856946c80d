"""The unknowns of the siblings: effects of the rig, as each of them draws their parameters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

from porotwin_core.geometry.grid import FloatArray
from porotwin_core.rig import EffectDescription, Rig
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.candidate import Candidate, FitParameter
from porotwin_solver.effects.rate import EFFECT as RATE
from porotwin_solver.effects.rate import rate_factors


@dataclass(frozen=True)
class Sibling:
    """The beliefs of one sibling about the rig.

    Attributes:
        changes: effects on top of those of rig.yaml.
        diagnosed: effects that a diagnosis found, drawn within their intervals.
        photograph_error: systematic error of the photographs, in standard deviations [-].
    """

    changes: tuple[EffectDescription, ...] = ()
    diagnosed: tuple[EffectDescription, ...] = ()
    photograph_error: float = field(kw_only=True)

    def with_pumps_of(self, other: 'Sibling') -> 'Sibling':
        """Return this sibling with the pumps of an `other`."""
        own = tuple(one for one in self.changes if one.name != RATE.name)
        pumps = tuple(one for one in other.changes if one.name == RATE.name)
        return replace(self, changes=own + pumps)

    @cached_property
    def rate_factors(self) -> dict[str, float]:
        """Believed delivered over commanded rate [-], by well."""
        return rate_factors(self.changes)


class Unknown(NamedTuple):
    """One number that the siblings disagree on, in steps: normal with mean 0 and deviation 1."""

    candidate: Candidate
    parameter: FitParameter


@dataclass(frozen=True)
class Unknowns:
    """All unknowns of a rig in their order, and the way from numbers to siblings.

    The last one is the error of the photographs.

    Attributes:
        believed: the effects that every rig may have, with their priors.
        diagnosed: the effects that a diagnosis found, with their intervals.
    """

    believed: tuple[Candidate, ...]
    diagnosed: tuple[Candidate, ...] = ()

    @classmethod
    def of(cls, rig: Rig, diagnosed: Sequence[Candidate] = ()) -> 'Unknowns':
        """Return the unknowns of `rig` and of effects that a diagnosis found."""
        believed = (one for effect in EFFECTS.values() for one in effect.believed(rig))
        return cls(tuple(believed), tuple(diagnosed))

    @property
    def listed(self) -> list[Unknown]:
        """Every unknown parameter of an effect; the photographs follow."""
        effects = (*self.believed, *self.diagnosed)
        return [Unknown(one, parameter) for one in effects for parameter in one.parameters]

    @cached_property
    def pumps(self) -> dict[str, tuple[int, float]]:
        """Place of the rate factor of each pump, and the step of its logarithm, by well."""
        return {
            str(candidate.fixed['well']): (place, factor.step)
            for place, (candidate, factor) in enumerate(replace(self, diagnosed=()).listed)
            if candidate.effect == RATE.name
        }

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return len(self.listed) + 1

    def sibling(self, values: FloatArray) -> Sibling:
        """Return the sibling with `values` of all unknowns [steps], (unknowns,)."""
        numbers = iter(map(float, values))
        return Sibling(
            tuple(drawn(one, numbers) for one in self.believed),
            tuple(drawn(one, numbers) for one in self.diagnosed),
            photograph_error=next(numbers),
        )


def drawn(candidate: Candidate, numbers: Iterator[float]) -> EffectDescription:
    """Return the effect with the next of `numbers` [steps] for its parameters."""
    return candidate.described([next(numbers) for _ in candidate.parameters])
