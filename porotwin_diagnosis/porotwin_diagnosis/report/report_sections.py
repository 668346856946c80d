"""The sections of the report below the pictures, each as HTML."""

import html
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from porotwin_core.clock.time_units import time_unit
from porotwin_diagnosis.advice.proposals import checks_of_form
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.report.answer import Summary, label, misplaced_fronts, origin, these
from porotwin_diagnosis.report.diagnosis_json import Errors, remaining_error
from porotwin_diagnosis.report.markup import percent, table
from porotwin_diagnosis.report.wording import inputs, phrase, spoken, spoken_label, value
from porotwin_diagnosis.search.ranking import misfit_beyond_noise, overall_misfit, score
from porotwin_diagnosis.thresholds import LEAST_RIVAL
from porotwin_solver.effects import EFFECTS
from porotwin_solver.effects.definition.words import number

BAR_PIXELS, LONGEST_BAR = 80, 1.5
"""Length [pixels] of a bar for the error without effects, and the longest bar relative to it."""

NO_SIGN = 0.003
"""Relative change of the error below which a fitted effect changed nothing: its parameters are then
those of no effect, and words for them read like nonsense."""

LEAST_PROBABILITY = 1e-3
"""Probabilities below 0.1 % are not written out."""

PUMPS = {
    'injecting': 'inject tracer',
    'chasing': 'pump, but no tracer',
    'resting': 'are off',
}
"""The operating states of `GapMap.phases` in words: the pumps do this."""


def tried_effects(result: Diagnosis, summary: Summary) -> str:
    """Return the table of all effects, each fitted alone, with the error that remains."""
    errors = summary['error']
    before, floor = max(errors['before'], 1e-9), errors['noise_floor']
    rows = []
    for row in summary['effects']:
        name, after = row['name'], row['error_after']
        length = BAR_PIXELS * min(max(after, floor) / before, LONGEST_BAR)
        rows.append(
            [
                f'<b>{spoken(name)}</b>' if name in result.verdict.members else spoken(name),
                origin(name),
                _meaning(row, named=name in result.verdict.members),
                f'<span class="bar" style="width:{length:.0f}px"></span>',
                percent(after) if after > floor else f'≤ {percent(floor)}',  # hidden in the noise
                _probability(row['probability']),
            ]
        )
    head = [
        'effect',
        'of',
        'meaning, if it were the cause',
        'error with it alone',
        '',
        'probability',
    ]
    note = (
        '<p>Every effect in the table was fitted to the first 70 % of the recording. The error is '
        'that of the last 30 %, the held-out part. Without any effect it is '
        f'{percent(before)}{_joint_error(result, summary)}. “≤” means at or below the noise. The '
        'errors differ a little from those of the answer, because the search uses larger '
        f'cells.{_left_out(result, summary)}</p>'
        '<p>The probability follows from the misfit at the fronts of the whole recording. So an '
        'effect with a smaller error may be less probable. All members of a combination have its '
        'probability. The sum may be below 100 %. The rest stands for everything else: no effect '
        'at all, causes outside the library, and what this recording is too coarse to show.</p>'
    )
    return note + table(head, rows, {4, 5})


def _left_out(result: Diagnosis, summary: Summary) -> str:
    """Return a sentence about the effects of the library that have no row, empty if all have."""
    rows = {row['name'] for row in summary['effects']}
    known = {*rows, *result.excluded}
    names = [spoken(e.name) for e in EFFECTS.values() if e.is_diagnosed and e.name not in known]
    if not names:
        return ''
    return (
        ' Some effects have no row. They cannot act in this recording, or nothing in it points to '
        f'them: {", ".join(names)}.'
    )


def _meaning(row: Mapping[str, Any], *, named: bool) -> str:
    """Return an effect with its fitted parameters in words, or that the maps show no sign of it."""
    change = abs(row['error_after'] - row['error_before'])
    if not named and change < NO_SIGN * row['error_before']:
        return 'no sign of it'
    return phrase(row['name'], row['parameters'])


def _joint_error(result: Diagnosis, summary: Summary) -> str:
    if len(result.verdict.members) < 2:
        return ''
    after = percent(summary['error']['after'])
    names = ' and '.join(spoken(name) for name in result.verdict.members)
    return f'; with {names} together it is {after} (their parameters are from the joint fit)'


def _probability(share: float) -> str:
    return '&lt; 0.1 %' if share < LEAST_PROBABILITY else percent(share)


def tried_pairs(result: Diagnosis, summary: Summary) -> str:
    """Return the table of the pairs that were judged, below the best single effect."""
    findings = result.evidence.findings
    if not findings.pairs:
        alone = 'the model as it is' if result.verdict.name == NONE else 'one effect alone'
        reason = f', because {alone} leaves no more error than a right model may leave'
        return f'<p>No pair was tried{"" if result.verdict.name == UNEXPLAINED else reason}.</p>'
    errors, kept = Errors(**summary['error']), result.verdict.model.label

    def error(fit: Fit) -> float:
        return errors.after if fit.label == kept else remaining_error(fit, errors, findings)

    rows = [
        [label(fit), percent(error(fit)), f'{max(misfit_beyond_noise(fit)):.2f}']
        for fit in (findings.singles[0], *findings.pairs, *findings.triples)
    ]
    note = '<p>The best single effect, and the combinations that reached the final judgement:</p>'
    return note + table(['effects', 'error with them', 'misfit beyond noise'], rows, {1, 2})


def when_it_arises(result: Diagnosis) -> str:
    """Return the table of the operating states with their shares of the gap."""
    several = len(result.recordings) > 1
    unit = time_unit(result.samples[0].duration)
    rows = [
        [
            f'{unit.number(phase.start)} – {unit.text(phase.end)}'
            + (
                f', {html.escape(result.recordings[phase.recording].source.name)}'
                if several
                else ''
            ),
            PUMPS[phase.state],
            f'{100 * phase.share:.0f} %',
        ]
        for phase in result.gap.phases
    ]
    return table(['time', 'pumps', 'share of the gap'], rows, {2})


def laboratory_checks(result: Diagnosis) -> str:
    """Return how to check the named effects, or the form of an unexplained gap."""
    checks = dict((*_checks_of_form(result), *_checks_of_effects(result)))
    if not checks:
        return (
            '<p>There is no effect to check. Look at the map of the remainder: is it at a well, '
            'along a side, at a layer, at a reflection in the glass? Did anybody touch the rig '
            'while the gap arose?</p>'
        )
    items = ''.join(f'<li><b>{name}</b>: {check}.</li>' for name, check in checks.items())
    return f'<ul>{items}</ul>'


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


def next_experiments(result: Diagnosis, summary: Summary) -> str:
    """Return the table of proposed experiments."""
    if result.verdict.stands_alone:
        return (
            '<p>Every other effect of the library has a probability below '
            f'{100 * LEAST_RIVAL:g} %, so no experiment is needed to tell them apart. The best '
            'test of the named effect is a recording with other wells or rates: its error must '
            'fall too.</p>'
        )
    if not result.proposals:
        return '<p>No other experiment shows more than a repetition of this recording.</p>'
    proposals = summary['next_experiment']
    if result.verdict.name == UNEXPLAINED:
        rows = [[proposal['name'], proposal['what']] for proposal in proposals]
        note = (
            '<p>Checks in the laboratory, and experiments that show the kind of the missing '
            'cause. An error that goes on while all pumps rest comes from the camera, the storage '
            'of tracer, a flow from outside, diffusion or a density difference. An error in the '
            'turn of one well only comes from its pump.</p>'
        )
        return note + table(['experiment', 'instructions'], rows)
    one, other = result.proposals[0].separates
    rows = [
        [
            proposal['name'],
            proposal['what'],
            'decides' if proposal['gain'] is None else f'{proposal["gain"]:.1f} times',
        ]
        for proposal in proposals
    ]
    note = (
        f'<p>These separate the two best explanations, {spoken_label(one)} and '
        f'{spoken_label(other)}.{_comparison(proposals)}</p>'
    )
    return note + table(['experiment', 'instructions', 'separates better'], rows, {2})


def _comparison(proposals: Sequence[Mapping[str, Any]]) -> str:
    """Explain the gains of the `proposals`; empty if all are checks in the laboratory."""
    if all(proposal['gain'] is None for proposal in proposals):
        return ''
    return (
        ' The last column compares how well each separates them with the same recording, made '
        'again.'
    )


def visible_strengths(result: Diagnosis) -> str:
    """Return the table of the smallest strengths that would have been visible."""
    rows = []
    for name, least in sorted(result.strengths.items()):
        is_factor = EFFECTS[name].parameters[least.parameter].is_factor
        text = (
            f'{number(100 * least.value, 2)} %'
            if is_factor
            else value(name, least.parameter, least.value, 2)
        )
        where = ', in the middle of the rig' if EFFECTS[name].has_place else ''
        if least.well:
            where = f', of {html.escape(least.well)}, where it shows best'
        plainly = EFFECTS[name].plainly
        rows.append(
            [
                f'{spoken(name)} ({plainly})' if plainly else spoken(name),
                f'{spoken(least.parameter)}{_neutral(name, least.parameter)}{where}',
                text,
            ]
        )
    note = (
        f'<p>An effect that {these(result)} did not show may still be there. The table gives the '
        'smallest deviation that would have been visible. It holds for each effect alone.</p>'
    )
    return note + table(['effect', 'parameter', 'least visible deviation'], rows, {2})


def _neutral(name: str, parameter: str) -> str:
    """State the value of a parameter without the effect; empty if it is 0."""
    neutral = EFFECTS[name].parameters[parameter].neutral
    return f' ({neutral:g} without the effect)' if neutral else ''


def _shared_errors(result: Diagnosis) -> str:
    """Return the sizes of errors that all maps share, in words; empty if the imaging gives none."""
    sizes = result.samples[0].shared_errors
    if sizes is None:
        return ''
    return (
        ' Errors that all maps share, as the imaging states them: scale '
        f'{percent(min(sizes.scales))} in the best known sand and {percent(max(sizes.scales))} in '
        f'the worst, half of the stock off by {percent(sizes.bend)}, places off by '
        f'{number(1e3 * sizes.place_m, 2)} mm. Every model, also the one without effects, was '
        'compared with the best values of these errors.'
    )


def method(result: Diagnosis) -> str:
    """Return how the diagnosis was made: simulations, noise, misfits."""
    findings, numerics = result.evidence.findings, result.evidence.numerics
    noise, model = result.samples[0].noise, result.verdict.model
    smearing = (
        f' The configured scheme ({numerics.preset}) smears fronts like a diffusion of '
        f'{number(numerics.model_diffusion, 2)} m²/s.'
        if numerics.smears
        else ''
    )
    return (
        f'<p>{findings.runs} simulations were made, each from the start. Their input: '
        f'{inputs(result.samples[0])}. Parameters were fitted to the first 70 % of the recording '
        f'and tested on the last 30 %.</p><p>Measured noise: grain {percent(noise.grain)}, frame '
        f'noise {percent(noise.frame)}, empty sand {percent(noise.background)} of the stock; '
        f'correlated over {noise.correlation:.1f} cells; fronts blurred over '
        f'{result.held_out[0].point_spread_width:.1f} cells.{_shared_errors(result)}</p>'
        '<p>Misfit at fronts, in standard '
        'deviations of the noise and of a front 0.12 cells off: '
        f'{score(findings.null):.2f} before, {score(model):.2f} after; noise alone gives '
        f'{overall_misfit(*model.noise_misfit):.2f}. Beyond the noise this is as if fronts were '
        f'{misplaced_fronts(result, findings.null)} off before, '
        f'and {misplaced_fronts(result, model)} after.{smearing}</p>'
    )
