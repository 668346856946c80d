"""Findings of earlier diagnoses of one rig, in the file `belief.json` of a folder."""

import json
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from porotwin_core.basis.errors import InputError, check_writable, refuse_file, writing
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import write_whole
from porotwin_core.model.effect_parameter import HALF_INTERVAL, SINCE
from porotwin_core.rig import EffectDescription, Rig
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_diagnosis.report.origin import place_of
from porotwin_diagnosis.thresholds import SAME_PLACE_M
from porotwin_recording.experiment.experiment_folder import RIG_FILE
from porotwin_recording.experiment.recording import Recording
from porotwin_recording.tables.one_writer import only_writer
from porotwin_recording.tables.recording_date import parse_date
from porotwin_solver.effects import EFFECTS

FILE = 'belief.json'
"""File of a folder of findings."""

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra='forbid', allow_inf_nan=False, strict=True)


class Value(_Record):
    """A parameter as one diagnosis found it, with its 90 % interval, in its unit."""

    value: float
    low: float
    high: float

    @model_validator(mode='after')
    def _ordered(self) -> Self:
        if self.low > self.high:
            raise ValueError('low is above high')
        if not math.isfinite(self.deviation * self.deviation):
            raise ValueError('low and high are too far apart')
        return self

    @property
    def deviation(self) -> float:
        """Standard deviation, in the unit of the value."""
        return (self.high - self.low) / (2.0 * HALF_INTERVAL)


class FoundCause(_Record):
    """An effect that one diagnosis named, at one well or place.

    Attributes:
        effect: its name.
        well: its well; empty if it has none.
        values: its parameters by name.
    """

    effect: str
    well: str = ''
    values: dict[str, Value]

    @model_validator(mode='after')
    def _known(self) -> Self:
        if self.effect not in EFFECTS:
            raise ValueError(f'there is no effect {self.effect}')
        unknown = sorted(set(self.values) - set(EFFECTS[self.effect].parameters))
        if unknown:
            raise ValueError(f'{self.effect} has no parameter {unknown[0]}')
        return self

    def may_be(self, other: 'FoundCause') -> bool:
        """Return whether both may be one cause: one effect at one well, and nearly at one place."""
        same = (self.effect, self.well) == (other.effect, other.well)
        return same and self.distance(other) <= SAME_PLACE_M

    def distance(self, other: 'FoundCause') -> float:
        """Return the distance [m] to `other`: 0 if the effect has no place."""
        if not {'x', 'z'} <= set(self.values) & set(other.values):
            return 0.0
        return math.hypot(*(self.values[axis].value - other.values[axis].value for axis in 'xz'))


class PastFinding(_Record):
    """The finding of one diagnosis.

    Attributes:
        date: when the recording was made, with a time zone, ISO 8601.
        recordings: the diagnosed recordings.
        rig: fingerprint of the rig without its effects.
        effects: effects that its rig.yaml held already; the causes come on top of them.
        verdict, confidence: as in `diagnosis.json`.
        causes: the named effects, and those that the recording cannot tell from them.
        named: names of the named effects.
        probabilities: those of every effect by name, as `diagnosis.json` states them.
        virtual: whether the virtual rig made one of the recordings.
    """

    date: str
    recordings: Annotated[tuple[str, ...], Field(min_length=1)]
    rig: str
    effects: tuple[dict[str, Any], ...] = ()
    verdict: str
    confidence: Probability
    causes: tuple[FoundCause, ...] = ()
    named: tuple[str, ...] = ()
    probabilities: dict[str, Probability] = Field(default_factory=dict)
    virtual: bool = False

    @model_validator(mode='after')
    def _known(self) -> Self:
        names = {self.verdict, *self.named, *self.probabilities}
        unknown = sorted(names - {NONE, UNEXPLAINED, *EFFECTS})
        if unknown:
            raise ValueError(f'there is no effect {unknown[0]}')
        return self

    @model_validator(mode='after')
    def _dated(self) -> Self:
        parse_date(self.date)  # its error is a ValueError
        return self

    @property
    def seconds(self) -> float:
        """The date as a time since 1970 [s]."""
        return datetime.fromisoformat(self.date).timestamp()

    @property
    def day(self) -> str:
        """The date without the time of day."""
        return self.date[:10]


_FINDINGS = TypeAdapter(tuple[PastFinding, ...])


def finding_from(
    summary: Mapping[str, Any], recordings: Sequence[Recording], date: datetime
) -> PastFinding:
    """Return the finding in the content of a diagnosis.json of `recordings` made on `date`."""
    rig = recordings[0].rig
    named, same = summary['combination'], summary['not_separable_from']
    known = [*named, *(name for name in same if name not in named)]
    return PastFinding(
        date=date.astimezone().isoformat(timespec='seconds'),
        recordings=tuple(str(place_of(recording.source)) for recording in recordings),
        rig=rig_without_effects(rig),
        effects=described(rig.effects),
        verdict=summary['verdict'],
        confidence=summary['confidence'],
        causes=tuple(map(_cause, named_rows(summary, [n for n in known if n in EFFECTS]))),
        named=tuple(named),
        probabilities={row['name']: row['probability'] for row in summary['effects']},
        virtual=is_virtual(recordings),
    )


def is_virtual(recordings: Sequence[Recording]) -> bool:
    """Return whether the virtual rig made one of the `recordings`."""
    return any(one.is_virtual for one in recordings)


def rig_without_effects(rig: Rig) -> str:
    """Return the fingerprint of `rig` as if its rig.yaml held no effects."""
    return rig.model_copy(update={'effects': ()}).physics_fingerprint


def described(effects: Sequence[EffectDescription]) -> tuple[dict[str, Any], ...]:
    """Return `effects` as a finding holds them."""
    return tuple(effect.model_dump(mode='json') for effect in effects)


def _cause(row: Mapping[str, Any]) -> FoundCause:
    parameters = row['parameters']
    return FoundCause(
        effect=row['name'],
        well=str(parameters.get('well', {}).get('value', '')),
        values={
            name: Value(**{key: float(entry[key]) for key in ('value', 'low', 'high')})
            for name, entry in parameters.items()
            if name != SINCE  # a time of one recording
            and entry.get('low') is not None
            and entry.get('high') is not None
        },
    )


def prepare_history(folder: Path) -> None:
    """Make the `folder` of a history, so that a diagnosis does not fail at its end.

    Raises:
        InputError: it cannot be a folder that is written into.
    """
    if folder == Path():
        raise InputError('--history: names no folder; name one for the findings on this rig')
    if folder.name == FILE:
        raise InputError(f'{folder}: name the folder of the findings, {folder.parent}')
    if (folder / RIG_FILE).is_file():
        raise InputError(f'{folder}: is a recording; name a folder of its own for the findings')
    refuse_file(folder, 'the findings on this rig')
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_writable(folder / FILE)


def read_history(folder: Path) -> tuple[PastFinding, ...]:
    """Return the findings in `folder`, the oldest first; none if it is new.

    Raises:
        InputError: the file is damaged.
    """
    path = folder / FILE
    if not path.exists():
        return ()
    remedy = 'correct it, or name another folder'
    try:
        findings = _FINDINGS.validate_json(read_regular(path))
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; {remedy}') from None
    except ValidationError as error:
        first = error.errors()[0]
        place = '.'.join(map(str, first['loc']))
        if first['type'] == 'extra_forbidden':
            remedy = 'was it written by a newer version? install that one, or name another folder'
        raise InputError(f'{path}: {" ".join([place, first["msg"]]).strip()}; {remedy}') from None
    return tuple(sorted(findings, key=lambda found: found.seconds))


def findings_on(
    rig: Rig, findings: Sequence[PastFinding], folder: Path, *, virtual: bool = False
) -> list[PastFinding]:
    """Return the `findings` that were made with the same effects in rig.yaml as `rig` has.

    Parameters are relative to the description of the rig, so that others cannot be compared.
    Findings on the `virtual` rig count for it alone: they say nothing about the real one.

    Raises:
        InputError: a finding belongs to another rig.
    """
    own = rig_without_effects(rig)
    foreign = [found for found in findings if found.rig != own]
    if foreign:
        raise InputError(
            f'{folder}: holds findings on another rig, or on another description of it, such as '
            f'that of {foreign[0].recordings[0]}; name another folder with --history'
        )
    return [
        found
        for found in findings
        if found.effects == described(rig.effects) and found.virtual == virtual
    ]


def add_finding(folder: Path, new: PastFinding) -> list[PastFinding]:
    """Write `new` into the history in `folder`; return the findings that it replaces.

    A recording counts once. So findings that share a recording with the new one are replaced. If
    one of them holds all its recordings and more, it stays, and the new one is not added.

    Raises:
        InputError: the folder cannot be written, or its file is damaged.
    """
    with only_writer(folder / FILE):
        present = read_history(folder)  # another call may have added one meanwhile
        own = set(new.recordings)
        if any(own < set(found.recordings) and _alike(found, new) for found in present):
            return []
        replaced = [f for f in present if own & set(f.recordings) and _alike(f, new)]
        kept = [found for found in present if found not in replaced]
        rows = [found.model_dump(mode='json') for found in (*kept, new)]
        write_whole(folder / FILE, json.dumps(rows, indent=1) + '\n')
    return replaced


def _alike(one: PastFinding, other: PastFinding) -> bool:
    """Return whether two findings have the same effects in rig.yaml, and the same kind of rig."""
    return one.effects == other.effects and one.virtual == other.virtual
