"""Findings of earlier diagnoses of one rig: the belief before the next diagnosis, and drifts.

A folder holds one file, `belief.json`, with a finding for each diagnosis. The belief about a
parameter is the mean of all findings of its effect, weighted by their precision. A parameter drifts
if two findings differ by more than their intervals allow.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.units import DAY_S
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.search.prior import Prior
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number, reading

FILE = 'belief.json'
"""File of a folder of findings."""

INTERVAL_DEVIATIONS = 3.29
"""Width of an interval of 90 % of a normal distribution, in standard deviations."""

DRIFT_DEVIATIONS = 2.6
"""Difference of two findings, in standard deviations of it, from which on it is a drift: chance
makes one in a hundred as large."""


@dataclass(frozen=True)
class Value:
    """A parameter of an effect as one diagnosis found it, with its 90 % interval, in its unit."""

    effect: str
    well: str
    parameter: str
    value: float
    low: float
    high: float

    @property
    def key(self) -> tuple[str, str, str]:
        """Effect, well and parameter of the value."""
        return self.effect, self.well, self.parameter

    @property
    def deviation(self) -> float:
        """Standard deviation, in the unit of the value."""
        return (self.high - self.low) / INTERVAL_DEVIATIONS


@dataclass(frozen=True)
class PastFinding:
    """The finding of one diagnosis, with the date of its recording.

    `probabilities` are those of every effect by name, as `diagnosis.json` states them.
    """

    date: str
    recording: str
    verdict: str
    confidence: float
    values: tuple[Value, ...] = field(default=())
    probabilities: dict[str, float] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """The date as a time since 1970 [s]."""
        return datetime.fromisoformat(self.date).timestamp()


def finding_from(summary: dict[str, Any], recording: Path) -> PastFinding:
    """Return the finding in the content of a diagnosis.json of `recording`.

    Its date is the recording's last change.

    Raises:
        InputError: the recording is not there.
    """
    try:
        changed = recording.stat().st_mtime
    except OSError as error:
        raise InputError(f'{recording}: {error.strerror}; name a recording that exists') from None
    values = [
        value
        for row in summary['effects']
        if row['name'] in summary['combination']
        for value in _values(row)
    ]
    return PastFinding(
        datetime.fromtimestamp(changed).astimezone().isoformat(timespec='seconds'),
        str(recording),
        str(summary['verdict']),
        float(summary['confidence']),
        tuple(values),
        {row['name']: float(row['probability']) for row in summary['effects']},
    )


def _values(row: dict[str, Any]) -> list[Value]:
    parameters = row['parameters']
    well = str(parameters.get('well', {}).get('value', ''))
    return [
        Value(row['name'], well, name, entry['value'], entry['low'], entry['high'])
        for name, entry in parameters.items()
        if entry.get('low') is not None and entry.get('high') is not None
    ]


def read_history(folder: Path) -> tuple[PastFinding, ...]:
    """Return the findings in `folder`, the oldest first; none if it is new.

    Raises:
        InputError: the file is damaged.
    """
    path = folder / FILE
    if not path.exists():
        return ()
    try:
        rows = json.loads(path.read_text(encoding='utf-8'))
        findings = [
            PastFinding(**{**row, 'values': tuple(Value(**value) for value in row['values'])})
            for row in rows
        ]
        return tuple(sorted(findings, key=lambda found: found.seconds))
    except OSError as error:
        raise InputError(f'{path}: {error.strerror}; name another folder') from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path}: damaged ({error!r}); remove it or name another folder') from None


def write_history(folder: Path, findings: Sequence[PastFinding]) -> None:
    """Write `findings` into `folder`, the whole file or nothing; a recording counts once.

    Raises:
        InputError: the folder cannot be written.
    """
    newest = {found.recording: found for found in findings}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f'{FILE}.part'
        text = json.dumps([asdict(found) for found in newest.values()], indent=1)
        part.write_text(text + '\n', encoding='utf-8')
        part.replace(folder / FILE)
    except OSError as error:
        raise InputError(f'{folder}: {error.strerror}; name another folder') from None


def belief(findings: Sequence[PastFinding]) -> dict[tuple[str, str, str], Value]:
    """Return the belief about every found parameter: the mean weighted by precision."""
    found: dict[tuple[str, str, str], list[Value]] = {}
    for finding in findings:
        for value in finding.values:
            found.setdefault(value.key, []).append(value)
    return {key: _weighted(values) for key, values in found.items()}


def prior_from(findings: Sequence[PastFinding]) -> Prior:
    """Return the belief before the next recording, from all `findings` so far.

    The newest finding tells the probabilities: it was itself made with the belief of the earlier
    ones. After an unexplained gap nothing is believed.
    """
    if not findings or findings[-1].verdict == UNEXPLAINED:
        return Prior()
    last = findings[-1]
    probabilities = last.probabilities or {last.verdict: last.confidence}
    if last.verdict == NONE:
        probabilities = {**probabilities, NONE: last.confidence}
    values = {key: (value.value, value.deviation) for key, value in belief(findings).items()}
    return Prior(probabilities, values)


def _weighted(values: Sequence[Value]) -> Value:
    least = min((one.deviation for one in values if one.deviation > 0.0), default=1.0)
    weights = [1.0 / max(one.deviation, 1e-3 * least) ** 2 for one in values]
    mean = sum(w * one.value for w, one in zip(weights, values, strict=True)) / sum(weights)
    half = 0.5 * INTERVAL_DEVIATIONS / math.sqrt(sum(weights))
    return Value(*values[0].key, mean, mean - half, mean + half)


def compared(earlier: Sequence[PastFinding], new: PastFinding) -> list[str]:
    """Return lines that compare a `new` finding with the `earlier` ones."""
    if not earlier:
        return ['no earlier finding: this one is the first belief']
    expected, together = belief(earlier), belief([*earlier, new])
    lines = [
        f'{_of(value)}: {_number(value, value.value)} now; '
        f'believed before: {_with_interval(expected[value.key])}; '
        f'together: {_with_interval(together[value.key])}'
        for value in new.values
        if value.key in expected
    ]
    lines += [line for value in new.values if (line := _drift(earlier, new, value))]
    named = {value.effect for value in new.values}
    last = earlier[-1]
    if new.verdict == NONE and last.verdict not in (NONE, UNEXPLAINED):
        lines.append(f'{_spoken(last.verdict)}, found on {last.date[:10]}, is not there any more')
    known = {found.verdict for found in earlier}
    known |= {value.effect for found in earlier for value in found.values}
    fresh = sorted(named - known)
    lines += [f'{_spoken(name)}: new; no earlier recording showed it' for name in fresh]
    return lines


def _drift(earlier: Sequence[PastFinding], new: PastFinding, value: Value) -> str:
    """Return a line if `value` has drifted since the last finding of it, else an empty string."""
    for found in reversed(earlier):
        for before in found.values:
            if before.key != value.key or new.seconds <= found.seconds:
                continue
            change = value.value - before.value
            if abs(change) <= DRIFT_DEVIATIONS * math.hypot(value.deviation, before.deviation):
                return ''
            days = (new.seconds - found.seconds) / DAY_S
            return (
                f'{_of(value)} drifts: {_number(value, before.value)} on {found.date[:10]}, '
                f'{_number(value, value.value)} now, {_number(value, change / days)} a day'
            )
    return ''


def _of(value: Value) -> str:
    return ' '.join(filter(None, [_spoken(value.effect), value.well, _spoken(value.parameter)]))


def _spoken(name: str) -> str:
    return name.replace('_', ' ')


def _with_interval(value: Value) -> str:
    middle, low, high = (_number(value, one) for one in (value.value, value.low, value.high))
    return f'{middle} ({low} to {high})'


def _number(value: Value, amount: float) -> str:
    factor, unit = reading(EFFECTS[value.effect].parameters[value.parameter])
    return f'{number(factor * amount)} {unit}'.strip()
