"""The verdict of a diagnosis for the running twin: reads diagnosis.json and checks the verdict."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_solver.effects import EFFECTS, effect
from porotwin_solver.effects.definition.effect import Scope
from porotwin_solver.effects.definition.words import plain
from porotwin_solver.effects_in_force import in_words

LEAST_CLOSED = 0.5
"""Share of the gap above the noise that an offered effect closes at least: below, something else
matters more."""

LEAST_GAIN = 0.1
"""Least share of the error of the model that an offered effect removes."""

SAME_PLACE_M = 0.1
"""Distance of two leaks or zones that may be one [m]: as far as a weak gap leaves a place open."""

SAME_SIZE = 0.3
"""Difference of two sizes of an effect that is no news, as a share of the larger one."""

Cause = frozenset[tuple[str, str]]
"""Names of effects, each with its well or an empty text: a verdict without its numbers."""


@dataclass(frozen=True)
class Finding:
    """A verdict on the running experiment.

    Attributes:
        verdict: its name.
        confidence: its probability [-].
        effects: the named effects of rig and wells, which the solver can run.
        camera: the named effects of the camera.
        error_before: relative L2 error of the model on the held-out part [-].
        error_after: the same with the effects [-].
        closed: share of the gap above the noise that closes [-].
        same: effects that the recording cannot separate from the first one.
        report: path of the report page.
    """

    verdict: str
    confidence: float
    effects: tuple[EffectDescription, ...]
    camera: tuple[EffectDescription, ...]
    error_before: float
    error_after: float
    closed: float
    same: tuple[str, ...] = ()
    report: str = ''

    @property
    def cause(self) -> Cause:
        """The effects without their numbers, to recognise a second verdict with the same cause."""
        return frozenset(
            (one.name, str(one.parameters.get('well', ''))) for one in (*self.effects, *self.camera)
        )

    def has_the_cause_of(self, other: 'Finding') -> bool:
        """Whether both findings name the same effects, wells and, within `SAME_PLACE_M`, places."""
        return self.cause == other.cause and all(
            math.dist(*places) <= SAME_PLACE_M
            for places in zip(self._places, other._places, strict=True)
        )

    def has_the_size_of(self, other: 'Finding') -> bool:
        """Whether all numbers of two findings with one cause differ by `SAME_SIZE` at most."""
        ours, theirs = self._sizes, other._sizes
        return ours.keys() == theirs.keys() and all(
            abs(size - theirs[key]) <= SAME_SIZE * max(abs(size), abs(theirs[key]))
            for key, size in ours.items()
        )

    @property
    def _sorted(self) -> list[EffectDescription]:
        """All named effects in an order that does not depend on their numbers."""
        named = (*self.effects, *self.camera)
        return sorted(named, key=lambda one: (one.name, str(one.parameters.get('well', ''))))

    @property
    def _places(self) -> list[tuple[float, float]]:
        """The places (x, z) [m] of the effects that have one."""
        return [
            (float(one.parameters['x']), float(one.parameters['z']))
            for one in self._sorted
            if {'x', 'z'} <= one.parameters.keys()
        ]

    @property
    def _sizes(self) -> dict[tuple[int, str], float]:
        """The distance of every number, but those of places, from the value of no effect."""
        return {
            (index, key): value - EFFECTS[one.name].parameters[key].neutral
            for index, one in enumerate(self._sorted)
            for key, value in one.parameters.items()
            if not isinstance(value, str) and key not in ('x', 'z')
        }

    @property
    def names_a_cause(self) -> bool:
        """Whether the verdict names a cause of a gap."""
        return self.verdict not in (NONE, UNEXPLAINED)

    def doubt(self, least_confidence: float) -> str:
        """Return one line with the reason against an offer; empty for a sure finding."""
        if self.verdict == NONE:
            return 'no gap: the model explains the photographs'
        if not self.names_a_cause:
            return f'a gap of {_percent(self.error_before)} that no known effect explains'
        if self.confidence < least_confidence:
            rounded_down = math.floor(100.0 * self.confidence + 1e-9) / 100.0
            return f'{self.verdict} with confidence {rounded_down:.2f}, below {least_confidence:g}'
        gained = self.error_after <= (1.0 - LEAST_GAIN) * self.error_before
        if self.closed < LEAST_CLOSED or not gained:
            return (
                f'{self.verdict} closes too little of the gap: the error goes from '
                f'{_percent(self.error_before)} to {_percent(self.error_after)}'
            )
        if not (self.effects or self.camera):
            return f'{self.verdict}: the numerical scheme; choose another --preset'
        return ''

    @property
    def sentence(self) -> str:
        """The sentence for the operator: the cause and the size of the improvement."""
        parts = []
        if self.effects:
            words = in_words(self.effects)
            same = f' (or {" or ".join(self.same)}, which looks the same)' if self.same else ''
            parts.append(
                f'{words[:1].upper()}{words[1:]}{same}: with it the model errs by '
                f'{_percent(self.error_after)} instead of {_percent(self.error_before)}.'
            )
        parts += [_of_camera(one) for one in self.camera]
        return ' '.join(parts)


def _percent(share: float) -> str:
    return f'{100.0 * share:.2g} %'


def _of_camera(one: EffectDescription) -> str:
    """Return an effect of the camera in words, and how to mend it."""
    found = EFFECTS[one.name]
    words = plain(found.phrase(one.parameters))
    return (
        f'The camera: {words}. The model cannot mend this; {plain(found.laboratory_check)}, '
        'then correct the camera or calibrate it again.'
    )


def read_finding(report: Path) -> Finding:
    """Return the finding of the diagnosis whose page is `report`; diagnosis.json lies beside it.

    Raises:
        InputError: the file cannot be read, or is no diagnosis.
    """
    path = report.with_name('diagnosis.json')
    try:
        return finding_of(json.loads(path.read_text(encoding='utf-8')), str(report))
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; diagnose again') from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f'{path}: no diagnosis ({error!r}); diagnose again') from None


def finding_of(summary: dict[str, Any], report: str = '') -> Finding:
    """Return the finding in the content of a diagnosis.json.

    Raises:
        KeyError: an entry is missing.
        InputError: an effect is unknown, or has another parameter; or the confidence is no
            probability.
    """
    named = [
        EffectDescription(
            name=row['name'],
            parameters=effect(row['name']).checked(
                {key: entry['value'] for key, entry in row['parameters'].items()}
            ),
        )
        for row in named_rows(summary, summary['combination'])
    ]
    errors = summary['error']
    confidence = float(summary['confidence'])
    if not 0.0 <= confidence <= 1.0:
        raise InputError(f'confidence {confidence:g} is not from 0 to 1; diagnose again')
    return Finding(
        verdict=summary['verdict'],
        confidence=confidence,
        effects=_of_scopes(named, Scope.RIG, Scope.WELL, Scope.PLACE),
        camera=_of_scopes(named, Scope.CAMERA),
        error_before=float(errors['before']),
        error_after=float(errors['after']),
        closed=float(errors['gap_closed']),
        same=tuple(name.replace('_', ' ') for name in summary['not_separable_from']),
        report=report,
    )


def _of_scopes(named: Sequence[EffectDescription], *scopes: Scope) -> tuple[EffectDescription, ...]:
    return tuple(one for one in named if effect(one.name).scope in scopes)
