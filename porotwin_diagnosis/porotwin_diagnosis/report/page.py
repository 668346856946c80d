"""The report for an experimenter: the answer, pictures and evidence on one page."""

import html
from collections.abc import Iterator
from pathlib import Path

from porotwin_core.basis.whole_file import write_whole
from porotwin_core.clock.time_units import time_unit
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report import figures
from porotwin_diagnosis.report.answer import Summary, answer, closed, sentence_box, these
from porotwin_diagnosis.report.markup import figure_with_caption, percent, table
from porotwin_diagnosis.report.photograph_figure import caption, photograph
from porotwin_diagnosis.report.report_sections import (
    laboratory_checks,
    method,
    next_experiments,
    tried_effects,
    tried_pairs,
    visible_strengths,
    when_it_arises,
)
from porotwin_diagnosis.report.wording import inputs, spoken_label
from porotwin_diagnosis.search.ranking import overall_misfit
from porotwin_solver.service.effects_in_force import in_words

STYLE = """
*{box-sizing:border-box}
body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:1.2rem auto;padding:0 1rem;
color:#1c2430;background:#fff;overflow-wrap:break-word}
h1{font-size:1.6rem;line-height:1.2;margin:0 0 .2rem} h2{font-size:1.15rem;margin-top:2rem}
.verdict{font-size:1.2rem;background:#eef4fa;border-left:5px solid #2a6fb0;padding:.7rem 1rem;
margin:.8rem 0}
.first{display:grid;gap:0 1.2rem;align-items:start}
.first.placed{grid-template-columns:minmax(0,1fr) minmax(0,1fr)}
.first figure{margin:0}
.answer th{width:5.5rem;color:#52606d;white-space:nowrap}
img{max-width:100%;height:auto} figure{margin:1.2rem 0}
figcaption{color:#52606d;font-size:.92rem}
.wide{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:.92rem}
td,th{padding:.3rem .6rem;text-align:left;border-bottom:1px solid #dde3ea;vertical-align:top}
td.n,th.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
.bar{display:inline-block;height:.7rem;background:#c8402f;vertical-align:middle}
small{color:#52606d}
.odd{border-left:4px solid #c8402f;padding:.1rem .8rem;margin:.6rem 0;font-size:.92rem}
.odd ul{margin:.2rem 0;padding-left:1.2rem}
@media (max-width:700px){
h1{font-size:1.25rem} .verdict{font-size:1.02rem;padding:.5rem .7rem}
.first.placed{grid-template-columns:minmax(0,1fr)}
td,th{padding:.25rem .35rem}
figure .wide img:not(.single){max-width:none}
.wide table:not(.answer){min-width:34rem}
}
@media print{
body{max-width:none;margin:0;font-size:10.5pt} figure,tr,.verdict{break-inside:avoid}
h2{break-after:avoid} .wide{overflow:visible}
.verdict,.bar{print-color-adjust:exact;-webkit-print-color-adjust:exact}
}
"""


def write_report(path: Path, result: Diagnosis, summary: Summary) -> None:
    """Write the page on `result`, whose diagnosis.json holds `summary`, as one HTML file.

    The page needs no other file.
    """
    title = f'Sim-to-real gap: {html.escape(_rig_in_words(result.recordings[0].rig.name))}'
    body = [
        f'<h1>{title}</h1>',
        f'<small>{_recordings(result)}</small>',
        sentence_box(result, summary),
        _odd_input(summary),
        _first_screen(result, summary),
        _by_recording(summary),
        *_figures(result),
        *_sections(result, summary),
    ]
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{title}</title><style>{STYLE}</style></head><body>{"".join(body)}</body></html>'
    )
    write_whole(path, page)


def _odd_input(summary: Summary) -> str:
    """Return what is odd in the recordings: it may be the cause of a gap, or hide one."""
    lines = ''.join(f'<li>{html.escape(line)}</li>' for line in summary['remarks'])
    return f'<div class="odd"><b>Odd in the recordings</b><ul>{lines}</ul></div>' if lines else ''


def _rig_in_words(name: str) -> str:
    return name if name.lower().endswith('rig') else f'{name} rig'


def _first_screen(result: Diagnosis, summary: Summary) -> str:
    """Return the answer beside the map of where the gap arises, if it has a place in the rig."""
    text = answer(result, summary)
    if not figures.arises_in_rig(result):
        return f'<div class="first">{text}</div>'
    picture = figure_with_caption(figures.where(result), _where_caption(result))
    return f'<div class="first placed">{text}{picture}</div>'


def _sections(result: Diagnosis, summary: Summary) -> Iterator[str]:
    """Yield all sections; without a gap only those that make sense, hidden effects first."""
    hidden = (f'Smallest effects that {these(result)} would have shown', visible_strengths(result))
    tables = tried_effects(result, summary) + tried_pairs(result, summary)
    tried = ('Effects that were tried', tables)
    how = ('Method', method(result))
    sections = [
        tried,
        ('When the gap arises', when_it_arises(result)),
        ('How to check it in the laboratory', laboratory_checks(result)),
        ('Next experiment', next_experiments(result, summary)),
        hidden,
        how,
    ]
    if result.verdict.name == NONE:
        sections = [hidden, tried, how]
    for title, content in sections:
        yield f'<h2>{title}</h2>{content}'


def _recordings(result: Diagnosis) -> str:
    """Say which recordings were diagnosed: duration, number of maps, cells, origin of the maps."""
    lines = []
    for recording, sample in zip(result.recordings, result.samples, strict=True):
        grid = recording.grid
        lines.append(
            f'{html.escape(str(recording.source))}: '
            f'{time_unit(sample.duration).text(sample.duration)}, '
            f'{len(recording.times)} maps of {grid.nx} × {grid.nz} cells of '
            f'{1e3 * grid.dx:.1f} mm, {html.escape(recording.present_maps.origin.in_words)}'
        )
    effects = result.recordings[0].rig.effects
    if effects:
        lines.append(f'The model as it is has the effects of rig.yaml: {in_words(effects)}')
    return '<br>'.join(lines)


def _by_recording(summary: Summary) -> str:
    """Return the errors of each recording; empty for a single one."""
    parts = summary['by_recording']
    if len(parts) < 2:
        return ''
    rows = [
        [
            html.escape(part['recording']),
            *(percent(part[key]) for key in ('before', 'after', 'noise_floor')),
            closed(part),
        ]
        for part in parts
    ]
    head = ['recording', 'error before', 'after', 'noise alone', 'gap closed']
    return table(head, rows, {1, 2, 3, 4})


def _figures(result: Diagnosis) -> Iterator[str]:
    """Yield all figures; where the gap arises and the remainder are shown once."""
    yield from _photograph(result)
    for number, recording in enumerate(result.recordings):
        which = f' ({recording.source.name})' if len(result.recordings) > 1 else ''
        told = _plumes_caption(result, number, which)
        yield figure_with_caption(figures.plumes(result, number), told)
        if number == 0:
            yield figure_with_caption(figures.gap(result), _gap_caption(result))
        if number == 0 and result.verdict.name == UNEXPLAINED:
            yield figure_with_caption(figures.remainder(result), _remainder_caption(result))
        yield figure_with_caption(
            figures.course(result, number),
            f'Error over time{which}. The model runs from the start to the end without correction; '
            f'its input: {inputs(result.samples[number])}. Effects were fitted to the part before '
            'the shaded one and tested in the shaded one. Below: the rates, thick where tracer is '
            'injected.',
        )


def _photograph(result: Diagnosis) -> Iterator[str]:
    """Yield the last photograph, if the recording holds one that can be read."""
    photos = [photo for photo in result.recordings[0].photos if photo.role == 'state']
    if not photos:
        return
    try:
        picture = photograph(photos[-1].read(), result)
    except (OSError, ValueError, SyntaxError):  # all errors that a broken file raises
        return
    yield figure_with_caption(picture, caption(photos[-1].time, result), 'jpeg')


def _plumes_caption(result: Diagnosis, number: int, which: str) -> str:
    colours = 'Red: more tracer in the rig than in the model. Blue: less.'
    first = f'The last map{which}, and the prediction from {inputs(result.samples[number])} alone.'
    if result.verdict.name == NONE:
        return f'{first} Right: the difference. {colours}'
    place = 'Right' if figures.is_tall(result.recordings[number].rig) else 'Below'
    return f'{first} {place}: the fronts (half of the stock), and the differences. {colours}'


def _where_caption(result: Diagnosis) -> str:
    together = ', all recordings together' if len(result.recordings) > 1 else ''
    return (
        'Where the gap arises, before the flow carries it on: the model starts anew from '
        f'every map and goes on to the next one{together}. Dotted circles: hot spots with their '
        f'share of the whole.{_marks_caption(result)}'
    )


def _gap_caption(result: Diagnosis) -> str:
    if result.verdict.name == NONE:
        return (
            'Left: the error if the model starts anew from every map and goes on to the next one. '
            'Right: the error of the model that runs from the start. There is no gap: both show '
            'noise, and small errors of solver and camera.'
        )
    wrong = 'here the model that runs from the start is wrong in the end.'
    if figures.arises_in_rig(result):
        return f'W{wrong}{_marks_caption(result)}'
    return (
        'Left: this map names no place in the rig, because the gap is made by the camera. It shows '
        'which fronts the camera changes from one photograph to the next. '
        f'Right: w{wrong}'
    )


def _marks_caption(result: Diagnosis) -> str:
    placed = any({'x', 'well'} & set(effect.parameters) for effect in result.verdict.model.effects)
    return (
        ' Light blue: the place of the named effect.' if placed and result.verdict.members else ''
    )


def _remainder_caption(result: Diagnosis) -> str:
    model = result.verdict.model
    return (
        'The remainder, which no effect of the library explains. Red: more tracer in the rig than '
        f'in the best model ({spoken_label(model.label)}). Blue: less. Right: the remainder of the '
        'whole recording in standard deviations of the noise and of a front 0.12 cells off; noise '
        f'alone gives about {overall_misfit(*model.noise_misfit):.1f}.'
    )
