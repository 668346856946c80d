"""The rows of the tables in the report below the pictures; `page.html` holds the words around."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from porotwin_core.clock.time_units import time_unit
from porotwin_core.model.gauge_reading import GaugeKind
from porotwin_diagnosis.advice.proposals import checks_of_form
from porotwin_diagnosis.decision.verdict import UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.report.answer import Summary, label, origin
from porotwin_diagnosis.report.diagnosis_json import Errors, remaining_error
from porotwin_diagnosis.report.wording import percent, phrase, spoken, spoken_label, value
from porotwin_diagnosis.search.ranking import misfit_beyond_noise
from porotwin_diagnosis.thresholds import LEAST_RIVAL
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number

BAR_PIXELS, LONGEST_BAR = 80, 1.5
"""Length [pixels] of a bar for the error without effects, and the longest bar relative to it."""

NO_SIGN = 0.003
"""Relative change of the error below which a fitted effect changed nothing: its parameters are then
those of no effect, and words for them read like nonsense."""

READ = {
    GaugeKind.OUTFLOW: 'outflow [ml]',
    GaugeKind.PRESSURE: 'pressure [Pa]',
    GaugeKind.CONCENTRATION: 'concentration of the outflow',
}
"""The kinds of readings in words."""

PUMPS = {
    'injecting': 'inject tracer',
    'chasing': 'pump, but no tracer',
    'resting': 'are off',
}
"""The operating states of `GapMap.phases` in words: the pumps do this."""


@dataclass(frozen=True)
class TriedEffect:
    """A row of the table of effects: one effect, fitted alone.

    Attributes:
        name: the effect in words; a named one is marked.
        origin: whether it is one of the rig, of the camera or of the model.
        meaning: the effect with its fitted parameters in words.
        bar: length of the bar for the error that remains [pixels].
        error: the error that remains.
        probability: probability that it is the cause.
    """

    name: str
    origin: str
    meaning: str
    bar: int
    error: str
    probability: str


def tried_effects(result: Diagnosis, summary: Summary) -> Iterator[TriedEffect]:
    """Yield all effects, each fitted alone, with the error that remains."""
    errors = summary['error']
    before, floor = max(errors['before'], 1e-9), errors['noise_floor']
    for row in summary['effects']:
        name, after = row['name'], row['error_after']
        named = name in result.verdict.members
        yield TriedEffect(
            f'**{spoken(name)}**' if named else spoken(name),
            origin(name),
            _meaning(row, named=named),
            round(BAR_PIXELS * min(max(after, floor) / before, LONGEST_BAR)),
            percent(after) if after > floor else f'≤ {percent(floor)}',  # hidden in the noise
            _probability(row['probability']),
        )


def effects_without_row(result: Diagnosis, summary: Summary) -> list[str]:
    """Return the effects of the library that have no row in the table, in words."""
    rows = {row['name'] for row in summary['effects']}
    known = {*rows, *result.excluded}
    return [spoken(e.name) for e in EFFECTS.values() if e.is_diagnosed and e.name not in known]


def _meaning(row: Mapping[str, Any], *, named: bool) -> str:
    """Return an effect with its fitted parameters in words, or that the maps show no sign of it."""
    change = abs(row['error_after'] - row['error_before'])
    if not named and change < NO_SIGN * row['error_before']:
        return 'no sign of it'
    return phrase(row['name'], row['parameters'])


def _probability(share: float) -> str:
    return '< 0.1 %' if share < LEAST_RIVAL else percent(share)


def tried_pairs(result: Diagnosis, summary: Summary) -> list[list[str]]:
    """Return the rows of the pairs that were judged, below the best single effect; empty: none."""
    findings = result.evidence.findings
    if not findings.pairs:
        return []
    errors, kept = Errors(**summary['error']), result.verdict.model.label

    def error(fit: Fit) -> float:
        return errors.after if fit.label == kept else remaining_error(fit, errors, findings)

    return [
        [label(fit), percent(error(fit)), f'{max(misfit_beyond_noise(fit)):.2f}']
        for fit in (findings.singles[0], *findings.pairs, *findings.triples)
    ]


def phases(result: Diagnosis) -> Iterator[list[str]]:
    """Yield the operating states with their shares of the gap."""
    unit = time_unit(result.samples[0].duration)
    for phase in result.gap.phases:
        time = f'{unit.number(phase.start)} – {unit.text(phase.end)}'
        if len(result.recordings) > 1:
            time = f'{time}, {result.recordings[phase.recording].source.name}'
        yield [time, PUMPS[phase.state], f'{100 * phase.share:.0f} %']


def readings(result: Diagnosis, summary: Summary) -> Iterator[list[str]]:
    """Yield the readings beside the maps, with the model before and after."""
    unit = time_unit(result.samples[0].duration)
    for one in summary['readings']:
        values = (number(one[key], 4) for key in ('before', 'after'))
        measured = f'{number(one["measured"], 4)} ± {number(one["deviation"], 2)}'
        place = f'{READ[one["kind"]]}, {one["place"]}'
        yield [place, unit.text(one['time_s']), measured, *values]


def laboratory_checks(result: Diagnosis) -> dict[str, str]:
    """Return how to check the named effects, or the form of an unexplained gap."""
    return dict((*_checks_of_form(result), *_checks_of_effects(result)))


def _checks_of_effects(result: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield a name and a check for the named effects, or for those that close much of the gap."""
    names = (*result.verdict.members, *result.verdict.not_separable)
    if result.partial is not None:
        names = tuple(member.effect for member in result.partial.model.members)
    for name in names:
        yield spoken(name), EFFECTS[name].laboratory_check


def _checks_of_form(result: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield a name and a check for every term of an unexplained gap, and for an open side."""
    if result.remainder is not None:
        for name, check in checks_of_form(result.remainder, result.recordings[0].rig):
            yield spoken_label(name), check


def next_experiments(result: Diagnosis, summary: Summary) -> Iterator[list[str]]:
    """Yield the proposed experiments."""
    for proposal in summary['next_experiment']:
        row = [proposal['name'], proposal['what']]
        if result.verdict.name != UNEXPLAINED:
            gain = proposal['gain']
            row.append('decides' if gain is None else f'{gain:.1f} times')
        yield row


def visible_strengths(result: Diagnosis) -> Iterator[list[str]]:
    """Yield the smallest strengths that would have been visible."""
    for name, least in sorted(result.strengths.items()):
        is_factor = EFFECTS[name].parameters[least.parameter].is_factor
        text = (
            f'{number(100 * least.value, 2)} %'
            if is_factor
            else value(name, least.parameter, least.value, 2)
        )
        where = ', in the middle of the rig' if EFFECTS[name].has_place else ''
        if least.well:
            where = f', of {least.well}, where it shows best'
        plainly = EFFECTS[name].plainly
        yield [
            f'{spoken(name)} ({plainly})' if plainly else spoken(name),
            f'{spoken(least.parameter)}{_neutral(name, least.parameter)}{where}',
            text,
        ]


def _neutral(name: str, parameter: str) -> str:
    """State the value of a parameter without the effect; empty if it is 0."""
    neutral = EFFECTS[name].parameters[parameter].neutral
    return f' ({neutral:g} without the effect)' if neutral else ''
