"""The verdict of a diagnosis for the running twin: reads diagnosis.json and checks the verdict."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.rig import EffectDescription
from porotwin_diagnosis.advice.remainder_form import WELL_CLOSED
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.report.named_rows import named_rows, verdict_words
from porotwin_diagnosis.thresholds import SAME_PLACE_M
from porotwin_solver.effects import EFFECTS, effect
from porotwin_solver.effects.definition.effect import Scope
from porotwin_solver.service.effects_in_force import in_words

LEAST_GAIN = 0.1
"""Least share of the error of the model that an offered effect removes."""

SAME_SIZE = 0.3
"""Difference of two sizes of an effect that is no news, as a share of the larger one."""

Cause = tuple[tuple[str, str], ...]
"""Sorted names of effects, each with its well or an empty text: a verdict without its numbers."""

Effects = tuple[EffectDescription, ...]


@dataclass(frozen=True)
class Finding:
    """A verdict on the running experiment.

    Attributes:
        verdict: its name, or those of all effects that act together.
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
    effects: Effects
    camera: Effects
    error_before: float
    error_after: float
    closed: float
    same: tuple[str, ...] = ()
    report: str = ''

    @property
    def cause(self) -> Cause:
        """The effects without their numbers, to recognise a second verdict with the same cause."""
        return tuple(sorted(map(_cause_of, self._named)))

    def has_the_cause_of(self, other: 'Finding') -> bool:
        """Whether both findings name the same effects, wells and, within `SAME_PLACE_M`, places."""
        return self.cause == other.cause and all(
            _distance(*pair) <= SAME_PLACE_M for pair in self._pairs(other)
        )

    def has_the_size_of(self, other: 'Finding') -> bool:
        """Whether all numbers of two findings with one cause differ by `SAME_SIZE` at most."""
        return all(_have_one_size(*pair) for pair in self._pairs(other))

    @property
    def _named(self) -> Effects:
        return (*self.effects, *self.camera)

    def _pairs(self, other: 'Finding') -> Iterator[tuple[EffectDescription, EffectDescription]]:
        """Yield each effect with the nearest one of the same name and well in `other`.

        Of two leaks, the stronger one comes first: their order may change with their numbers.
        """
        left = list(other._named)
        for one in self._named:
            same = [item for item in left if _cause_of(item) == _cause_of(one)]
            nearest = min(same, key=lambda item: _distance(one, item))
            left.remove(nearest)
            yield one, nearest

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
        if self.closed < WELL_CLOSED or not gained:
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
            both = ', and with the camera corrected,' if self.camera else ''
            parts.append(
                f'{words[:1].upper()}{words[1:]}{same}: with it{both} the model errs by '
                f'{_percent(self.error_after)} instead of {_percent(self.error_before)}.'
            )
        parts += [_of_camera(one) for one in self.camera]
        return ' '.join(parts)


def _cause_of(one: EffectDescription) -> tuple[str, str]:
    return one.name, str(one.parameters.get('well', ''))


def _distance(one: EffectDescription, other: EffectDescription) -> float:
    """Return the distance [m] of two effects with one name; 0 if it has no place."""
    if not {'x', 'z'} <= one.parameters.keys():
        return 0.0
    return math.hypot(*(float(one.parameters[x]) - float(other.parameters[x]) for x in 'xz'))


def _have_one_size(one: EffectDescription, other: EffectDescription) -> bool:
    """Return whether the numbers of two effects, but those of places, are nearly the same.

    They count by their distances from the value of no effect.
    """
    ours, theirs = _sizes(one), _sizes(other)
    return ours.keys() == theirs.keys() and all(
        abs(size - theirs[key]) <= SAME_SIZE * max(abs(size), abs(theirs[key]))
        for key, size in ours.items()
    )


def _sizes(one: EffectDescription) -> dict[str, float]:
    return {
        key: value - EFFECTS[one.name].parameters[key].neutral
        for key, value in one.parameters.items()
        if not isinstance(value, str) and key not in ('x', 'z')
    }


def _percent(share: float) -> str:
    return f'{100.0 * share:.2g} %'


def _of_camera(one: EffectDescription) -> str:
    """Return an effect of the camera in words, and how to mend it."""
    found = EFFECTS[one.name]
    words = found.phrase(one.parameters)
    return (
        f'The camera: {words}. The model cannot mend this; {found.laboratory_check}, '
        'then correct the camera or calibrate it again.'
    )


def read_finding(report: Path) -> Finding:
    """Return the finding of the diagnosis whose page is `report`; diagnosis.json lies beside it.

    Raises:
        InputError: the file cannot be read, or is no diagnosis.
    """
    path = report.with_name('diagnosis.json')
    try:
        return finding_of(json_value(read_regular(path)), str(report))
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
        verdict=verdict_words(summary),
        confidence=confidence,
        effects=_of_scopes(named, Scope.RIG, Scope.WELL, Scope.PLACE),
        camera=_of_scopes(named, Scope.CAMERA),
        error_before=float(errors['before']),
        error_after=float(errors['after']),
        closed=float(errors['gap_closed']),
        same=tuple(name.replace('_', ' ') for name in summary['not_separable_from']),
        report=report,
    )


def _of_scopes(named: Sequence[EffectDescription], *scopes: Scope) -> Effects:
    return tuple(one for one in named if effect(one.name).scope in scopes)
