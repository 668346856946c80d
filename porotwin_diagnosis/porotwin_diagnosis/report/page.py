"""The report that a physicist reads: pictures first, then the evidence, on one page."""

import base64
import html
import io
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from porotwin_diagnosis.data.sample import FRONT_TOLERANCE
from porotwin_diagnosis.decision.held_out import WORSE, softened
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.model.candidate import CAMERA, LOCAL
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.report import figures as pictures
from porotwin_diagnosis.report.diagnosis_json import FIXED_UNITS, error_left
from porotwin_diagnosis.report.wording import CHECKS, interval, number, phrase, spoken, value
from porotwin_diagnosis.search.ranking import misfit_beyond_noise, overall_misfit, score

if TYPE_CHECKING:
    from porotwin_diagnosis.examine import Diagnosis

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:2rem auto;padding:0 1rem;
color:#1c2430}
h1{font-size:1.6rem;margin-bottom:.2rem} h2{font-size:1.15rem;margin-top:2rem}
.verdict{font-size:1.2rem;background:#eef4fa;border-left:5px solid #2a6fb0;padding:.8rem 1rem}
img{max-width:100%;height:auto} figure{margin:1.2rem 0}
figcaption{color:#52606d;font-size:.92rem}
table{border-collapse:collapse;width:100%;font-size:.92rem}
td,th{padding:.3rem .6rem;text-align:left;border-bottom:1px solid #dde3ea;vertical-align:top}
td.n,th.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
.bar{display:inline-block;height:.7rem;background:#c8402f;vertical-align:middle}
small{color:#52606d}
"""


def write_report(path: Path, result: 'Diagnosis') -> None:
    """Write the page for `result`; it needs nothing beside itself."""
    title = f'Sim-to-real gap: {html.escape(result.recordings[0].rig.name)} rig'
    body = [
        f'<h1>{title}</h1>',
        f'<small>{_recordings(result)}</small>',
        f'<p class="verdict">{sentence(result)}</p>',
        *_kept(result),
        *_pictures(result),
        *_sections(result),
    ]
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<style>{STYLE}</style></head><body>{"".join(body)}</body></html>'
    )
    path.write_text(page, encoding='utf-8')


def _sections(result: 'Diagnosis') -> Iterator[str]:
    unseen = (f'What {_these(result)} could not have shown', _strengths(result))
    sections = [
        ('What was tried', _ranking(result) + _pairs(result)),
        ('When the gap arises', _phases(result)),
        ('How to check it in the laboratory', _checks(result)),
        ('Next experiment', _proposals(result)),
        unseen,
        ('How it was done', _method(result)),
    ]
    if result.verdict.name == NONE:
        sections = [unseen, sections[0], sections[-1]]
    for title, content in sections:
        yield f'<h2>{title}</h2>{content}'


def _recordings(result: 'Diagnosis') -> str:
    lines = []
    for recording, sample in zip(result.recordings, result.samples, strict=True):
        grid = recording.grid
        lines.append(
            f'{html.escape(str(recording.source))}: {sample.duration / 60:.0f} min, '
            f'{len(recording.times)} maps of {grid.nx} × {grid.nz} cells of '
            f'{1e3 * grid.dx:.1f} mm'
        )
    return '<br>'.join(lines)


def _these(result: 'Diagnosis') -> str:
    return 'this recording' if len(result.recordings) == 1 else 'these recordings'


def sentence(result: 'Diagnosis') -> str:
    """Return the verdict on `result` in a sentence, as HTML."""
    verdict, errors = result.verdict, result.summary['error']
    sure = f'confidence {100 * verdict.confidence:.0f} %'
    before, after = (_percent(errors[key]) for key in ('before', 'after'))
    floor = f'noise and softness of the maps alone leave {_percent(errors["noise_floor"])}'
    if verdict.name == NONE:
        return (
            f'<b>No gap.</b> The model as it is explains {_these(result)} down to the noise: it '
            f'misses the held-out part by {before}, and {floor} ({sure}).'
        )
    if verdict.name == UNEXPLAINED:
        findings = result.findings
        pairs = ', nor of their best pairs,' if findings.pairs else ''
        tried = len({fit.members[0].effect for fit in findings.screened})
        return (
            f'<b>Unexplained.</b> There is a gap: the model misses the held-out part by {before}, '
            f'while {floor}. None of the {tried} effects of the library{pairs} accounts for it: '
            f'{_the_best(result)}, with {_beyond_noise(result, verdict.model)} ({sure}).'
        )
    alike = verdict.alternatives or [(name, *verdict.members[1:]) for name in verdict.inseparable]
    names = ' or '.join(map(_together, [verdict.members, *alike]))
    means = ', and '.join(_meaning(name, result) for name in verdict.members)
    if alike:
        names += f', which {_these(result)} cannot tell apart'
    if not verdict.alternatives:
        means = ', or '.join([means, *(_meaning(name, result) for name in verdict.inseparable)])
    said = f'{names[:3]}{names[3:4].upper()}{names[4:]}: {means} ({sure}).'
    if errors['after'] >= errors['before']:
        return f'{said} {_hardly_seen(result)}'
    return (
        f'{said} Mended, the model misses the held-out part by {after} instead of {before}; '
        f'{floor}, so that {_closed(errors)} of the gap is closed.'
    )


def _hardly_seen(result: 'Diagnosis') -> str:
    """Say where an effect shows that the plain error of the held-out part does not."""
    soft_before, soft_after = softened(result.held_out)
    before, after = result.findings.null.fitted_error, result.verdict.model.fitted_error
    if soft_after >= soft_before / WORSE:
        return (
            f'The gap lies in the part before: mended, the model misses that by {_percent(after)} '
            f'instead of {_percent(before)}, and the held-out part by {_percent(soft_after)} '
            'either way.'
        )
    return (
        'Mended, and with fronts as soft as the camera shows them, the model misses the held-out '
        f'part by {_percent(soft_after)} instead of {_percent(soft_before)}.'
    )


def _the_best(result: 'Diagnosis') -> str:
    """Say what the best model misses that is not good enough."""
    errors, name = result.summary['error'], _label(result.verdict.model)
    after = _percent(errors['after'])
    if errors['after'] < errors['before']:
        return f'the best, {name}, still misses it by {after}'
    return f'with {name}, which suits the part before best, it misses it by {after}'


def _together(names: Iterable[str]) -> str:
    return ' and '.join(f'<b>{spoken(name)}</b>' for name in names)


def _closed(errors: Mapping[str, float]) -> str:
    ends = ('gap_closed', 'gap_closed_low', 'gap_closed_high')
    closed, low, high = (100 * min(max(errors[end], 0.0), 1.0) for end in ends)
    return f'{closed:.0f} % ({low:.0f} … {high:.0f} %)'


def _members_and_alike(result: 'Diagnosis') -> tuple[str, ...]:
    return (*result.verdict.members, *result.verdict.inseparable)


def _meaning(name: str, result: 'Diagnosis') -> str:
    row = next(row for row in result.summary['effects'] if row['name'] == name)
    return phrase(name, row['parameters'])


def _label(fit: Fit) -> str:
    return html.escape(spoken(fit.label))


def _percent(share: float) -> str:
    return f'{100 * share:.1f} %'


def _beyond_noise(result: 'Diagnosis', fit: Fit) -> str:
    """Say what `fit` leaves beyond the noise, as what misplaced fronts would leave."""
    shift = max(misfit_beyond_noise(fit)) * FRONT_TOLERANCE * result.samples[0].grid.dx
    return f'as much beyond the noise as fronts {number(1e3 * shift, 2)} mm off would leave'


def _kept(result: 'Diagnosis') -> Iterator[str]:
    """Yield the table of the kept effects' parameters with their intervals, and of those that show
    the same; not beside a partner, for those were fitted alone."""
    rows = []
    members = result.verdict.members
    kept = members if len(members) > 1 else _members_and_alike(result)
    for row in result.summary['effects']:
        if row['name'] not in kept:
            continue
        for name, parameter in row['parameters'].items():
            fixed = name in FIXED_UNITS and parameter['low'] is None
            if not fixed:
                middle, span = interval(name, parameter)
                rows.append([spoken(row['name']), spoken(name), middle, span])
    if rows:
        yield _table(['effect', 'parameter', 'found', '90 % interval'], rows, {2, 3})
    if len(result.held_out) > 1:
        errors = [
            [
                html.escape(row['recording']),
                *(_percent(row[key]) for key in ('before', 'after', 'noise_floor')),
                _closed(row),
            ]
            for row in result.summary['by_recording']
        ]
        head = ['recording', 'error before', 'after', 'noise alone', 'gap closed']
        yield _table(head, errors, {1, 2, 3, 4})


def _pictures(result: 'Diagnosis') -> Iterator[str]:
    yield from _photo(result)
    for index, recording in enumerate(result.recordings):
        which = f' ({recording.source.name})' if len(result.recordings) > 1 else ''
        yield _figure(
            pictures.plumes(result, index),
            f'The last photograph’s map{which}, and what the model makes of it from the pumps’ '
            f'rates alone. {_below(result)}',
        )
        if index == 0:
            yield _figure(pictures.gap(result), _gap_caption(result))
        if index == 0 and result.verdict.name == UNEXPLAINED:
            yield _figure(
                pictures.remainder(result),
                'The remainder, which no effect of the library accounts for. Red: more tracer in '
                f'the rig than in the best model ({spoken(result.verdict.model.label)}); blue: '
                'less. Right: divided by what noise and a front 0.12 cells off would leave, over '
                'the whole recording; noise alone leaves about '
                f'{overall_misfit(*result.verdict.model.noise_misfit):.1f}.',
            )
        yield _figure(
            pictures.course(result, index),
            f'Error over time{which}: the model runs from the start to the end, fed with nothing '
            'but rates; effects are fitted left of the shaded part and judged in it. Below: what '
            'the pumps did, thick where tracer is injected.',
        )


def _below(result: 'Diagnosis') -> str:
    if result.verdict.name == NONE:
        return 'Right, red: more tracer in the rig than in the model; blue: less.'
    return (
        'Below: where each holds half the stock, and the differences; red: more tracer in the rig '
        'than in the model; blue: less.'
    )


def _gap_caption(result: 'Diagnosis') -> str:
    if result.verdict.name == NONE:
        return (
            'Left: what one short step of the model misses (one-step residuals in weak form). '
            'Right: error of the free-running model. There is no gap: both show the noise.'
        )
    marks = (
        ' Light blue: the place of the effect found.'
        if any({'x', 'well'} & set(effect.parameters) for effect in result.verdict.model.effects)
        and result.verdict.members
        else ''
    )
    together = ', all recordings together' if len(result.recordings) > 1 else ''
    return (
        'Left: where the gap arises, before the flow has carried it anywhere (one-step residuals in'
        f' weak form){together}; dotted: hot spots with their share of the whole. Right: where the '
        f'free-running model is wrong in the end.{marks}'
    )


def _photo(result: 'Diagnosis') -> Iterator[str]:
    """Yield the last photograph, where the recording holds one that can be read."""
    photos = [photo for photo in result.recordings[0].photos if photo.role == 'state']
    if not photos:
        return
    try:
        picture = pictures.photograph(photos[-1].read())
    except (OSError, ValueError, SyntaxError):  # all that a broken file makes the reader raise
        return
    yield _figure(picture, f'The last photograph, {photos[-1].time / 60:.0f} min.', 'jpeg')


def _figure(figure: Figure, caption: str, kind: str = 'png') -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format=kind, dpi=130)
    content = base64.b64encode(buffer.getvalue()).decode('ascii')
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/{kind};base64,{content}">'
        f'<figcaption>{text}</figcaption></figure>'
    )


def _table(head: list[str], rows: list[list[str]], numbers: set[int]) -> str:
    def row(cells: list[str], tag: str) -> str:
        marks = [' class="n"' if index in numbers else '' for index in range(len(cells))]
        joined = ''.join(
            f'<{tag}{mark}>{cell}</{tag}>' for mark, cell in zip(marks, cells, strict=True)
        )
        return f'<tr>{joined}</tr>'

    return f'<table>{row(head, "th")}{"".join(row(cells, "td") for cells in rows)}</table>'


def _ranking(result: 'Diagnosis') -> str:
    """Return the table of all effects, each fitted alone, with what it leaves."""
    errors = result.summary['error']
    before, floor = max(errors['before'], 1e-9), errors['noise_floor']
    rows = []
    for row in result.summary['effects']:
        name, left = row['name'], row['error_after']
        length = 80 * min(max(left, floor) / before, 1.5)
        cells = [
            f'<b>{spoken(name)}</b>' if name in result.verdict.members else spoken(name),
            'camera' if name in CAMERA else 'rig',
            phrase(name, row['parameters']),
            f'<span class="bar" style="width:{length:.0f}px"></span>',
            _percent(left) if left > floor else f'≤ {_percent(floor)}',  # nothing shows in noise
        ]
        rows.append([*cells, _probability(row['probability'])])
    head = ['effect', 'of', 'would mean', 'leaves, alone', '', 'probability']
    note = (
        f'<p>Every effect in the table was fitted to the first 70 % of the recording. Without any'
        f' effect the error of the held-out part is {_percent(before)}'
        f'{_jointly(result)}. Probabilities come from the misfit at the fronts of the '
        'whole recording; the members of a pair have that of the pair, and what is missing to '
        '100 % is left to what the library lacks.</p>'
    )
    return note + _table(head, rows, {4, 5})


def _jointly(result: 'Diagnosis') -> str:
    if len(result.verdict.members) < 2:
        return ''
    after = _percent(result.summary['error']['after'])
    names = ' and '.join(spoken(name) for name in result.verdict.members)
    return f'; with {names} together it is {after} (their values are those of the joint fit)'


def _probability(share: float) -> str:
    return '&lt; 0.1 %' if share < 1e-3 else _percent(share)


def _pairs(result: 'Diagnosis') -> str:
    findings = result.findings
    if not findings.pairs:
        return '<p>No pair was tried: nothing is left for a second effect.</p>'
    errors, kept = result.summary['error'], result.verdict.model.label

    def left(fit: Fit) -> float:
        known = fit.label == kept
        return float(errors['after']) if known else error_left(fit, errors, findings)

    rows = [
        [_label(fit), _percent(left(fit)), f'{max(misfit_beyond_noise(fit)):.2f}']
        for fit in (findings.singles[0], *findings.pairs)
    ]
    note = '<p>Pairs that went as far as the final judgement, below the best single effect:</p>'
    return note + _table(['effects', 'leave', 'misfit beyond noise'], rows, {1, 2})


def _phases(result: 'Diagnosis') -> str:
    several = len(result.recordings) > 1
    rows = [
        [
            f'{phase.start / 60:.0f} – {phase.end / 60:.0f} min'
            + (f', {result.recordings[phase.recording].source.name}' if several else ''),
            phase.state,
            f'{100 * phase.share:.0f} %',
        ]
        for phase in result.gap.phases
    ]
    return _table(['time', 'pumps', 'share of the gap'], rows, {2})


def _checks(result: 'Diagnosis') -> str:
    names = _members_and_alike(result)
    if not names:
        return (
            '<p>No effect to check. Look at the remainder’s map: does it lie at a well, along a '
            'side, at a layer, at a reflection in the glass? Did anybody touch the rig while the '
            'gap arose?</p>'
        )
    items = ''.join(f'<li><b>{spoken(name)}</b>: {CHECKS[name]}.</li>' for name in names)
    return f'<ul>{items}</ul>'


def _proposals(result: 'Diagnosis') -> str:
    if not result.proposals:
        return '<p>None that would tell more than the same recording once more.</p>'
    one, other = result.proposals[0].separates
    lacking = ', neither of which is enough' if result.verdict.name == UNEXPLAINED else ''
    rows = [
        [
            proposal.name,
            proposal.what,
            'decides' if proposal.gain is None else f'× {proposal.gain:.1f}',
        ]
        for proposal in result.proposals
    ]
    note = (
        f'<p>To tell the two nearest explanations apart, {spoken(one)} and {spoken(other)}'
        f'{lacking}; the factor says how many times better than the same recording once more.</p>'
    )
    return note + _table(['experiment', 'what to do', 'tells'], rows, {2})


def _strengths(result: 'Diagnosis') -> str:
    rows = []
    for name, entry in sorted(result.strengths.items()):
        amount, parameter = float(entry['value']), str(entry['parameter'])
        unit = str(entry['unit'])
        factor = unit == '-' and parameter not in ('exponent', 'immobile_fraction')
        least = f'{number(100 * amount, 2)} %' if factor else value(parameter, amount, unit, 2)
        where = ', in the middle of the rig' if name in LOCAL else ''
        rows.append([spoken(name), f'{spoken(parameter)}{where}', least])
    note = (
        '<p>Not seen is not absent: alone and weaker than this, an effect might not have stood out '
        f'in {_these(result)}.</p>'
    )
    return note + _table(['effect', 'parameter', 'least deviation that shows'], rows, {2})


def _method(result: 'Diagnosis') -> str:
    findings, noise, numerics = result.findings, result.samples[0].noise, result.numerics
    smear = (
        f'The configured model ({numerics.preset}) smears like a diffusion of '
        f'{number(numerics.model_diffusion, 2)} m²/s. '
        if numerics.found
        else ''
    )
    return (
        f'<p>{findings.runs} free-running simulations, each from the start, fed with nothing but '
        'rates. Parameters were fitted to the first 70 % of the recording and judged on the last '
        f'30 %. Measured noise: grain {_percent(noise.grain)}, frame {_percent(noise.frame)}, empty'
        f' sand {_percent(noise.background)} of the stock, correlated over '
        f'{noise.correlation:.1f} cells; fronts as soft as blurred over '
        f'{result.held_out[0].blur:.1f} cells. Misfit at fronts, in deviations of noise and of a '
        f'front 0.12 cells off: {score(findings.null):.2f} before, '
        f'{score(result.verdict.model):.2f} after; noise alone '
        f'{overall_misfit(*result.verdict.model.noise_misfit):.2f}. Before, there is '
        f'{_beyond_noise(result, findings.null)}; after, '
        f'{_beyond_noise(result, result.verdict.model)}. {smear}</p>'
    )
