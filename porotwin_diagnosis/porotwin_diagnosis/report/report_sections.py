"""The rows of the tables in the report below the pictures; `page.html` holds the words."""

from collections.abc import Iterator
from typing import NamedTuple

from porotwin_diagnosis.advice.proposals import checks_of_form
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report.answer import Summary
from porotwin_diagnosis.report.diagnosis_json import Errors, remaining_error
from porotwin_diagnosis.report.wording import spoken, spoken_label
from porotwin_diagnosis.search.ranking import misfit_beyond_noise
from porotwin_diagnosis.thresholds import LEAST_RIVAL
from porotwin_solver.effects import EFFECTS

BAR_PIXELS, LONGEST_BAR = 80, 1.5
"""Length [pixels] of a bar for the error without effects, and the longest bar relative to it."""

NO_SIGN = 0.003
"""Relative change of the error below which a fitted effect changed nothing: its parameters are then
those of no effect, and words for them read like nonsense."""


class TriedEffect(NamedTuple):
    """A row of the table of effects: one effect, fitted alone.

    Attributes:
        row: its row in diagnosis.json.
        is_named: whether the verdict names it.
        has_sign: whether the maps show a sign of it.
        is_hidden: whether the error that remains is hidden in the noise.
        is_improbable: whether it needs no figure of its probability.
        bar: length of the bar for the error that remains [pixels].
    """

    row: Summary
    is_named: bool
    has_sign: bool
    is_hidden: bool
    is_improbable: bool
    bar: int


class TriedSet(NamedTuple):
    """Effects that were judged together: label, error [-] and misfit beyond the noise with them."""

    label: str
    error: float
    misfit: float


def tried_effects(result: Diagnosis, summary: Summary) -> Iterator[TriedEffect]:
    """Yield all effects, each fitted alone."""
    before, floor = max(summary['error']['before'], 1e-9), summary['error']['noise_floor']
    for row in summary['effects']:
        after, is_named = row['error_after'], row['name'] in result.verdict.members
        change = abs(after - row['error_before'])
        yield TriedEffect(
            row,
            is_named,
            has_sign=is_named or change >= NO_SIGN * row['error_before'],
            is_hidden=after <= floor,
            is_improbable=row['probability'] < LEAST_RIVAL,
            bar=round(BAR_PIXELS * min(max(after, floor) / before, LONGEST_BAR)),
        )


def effects_without_row(result: Diagnosis, summary: Summary) -> list[str]:
    """Return the effects of the library that have no row in the table."""
    known = {*(row['name'] for row in summary['effects']), *result.excluded}
    return [e.name for e in EFFECTS.values() if e.is_diagnosed and e.name not in known]


def tried_sets(result: Diagnosis, summary: Summary) -> list[TriedSet]:
    """Return the sets that were judged, below the best single effect; empty: none."""
    findings = result.evidence.findings
    if not findings.pairs:
        return []
    errors, kept = Errors(**summary['error']), result.verdict.model.label
    return [
        TriedSet(
            fit.label,
            errors.after if fit.label == kept else remaining_error(fit, errors, findings),
            max(misfit_beyond_noise(fit)),
        )
        for fit in (findings.singles[0], *findings.pairs, *findings.triples)
    ]


def laboratory_checks(result: Diagnosis) -> dict[str, str]:
    """Return how to check the named effects, or the form of an unexplained gap and its part."""
    form, names = result.remainder, (*result.verdict.members, *result.verdict.not_separable)
    if result.partial is not None:
        names = tuple(member.effect for member in result.partial.model.members)
    terms = checks_of_form(form, result.recordings[0].rig) if form is not None else ()
    return {
        **{spoken_label(name): check for name, check in terms},
        **{spoken(name): EFFECTS[name].laboratory_check for name in names},
    }
