"""The report for an experimenter: the answer, pictures and evidence on one page, `page.html`."""

from collections.abc import Iterator
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from porotwin_core.basis.whole_file import write_whole
from porotwin_core.clock.time_units import time_unit
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report import figures
from porotwin_diagnosis.report import report_sections as sections
from porotwin_diagnosis.report.answer import (
    Summary,
    answer,
    closed,
    misplaced_fronts,
    sentence,
    these,
)
from porotwin_diagnosis.report.photograph_figure import caption, photograph
from porotwin_diagnosis.report.picture import Picture
from porotwin_diagnosis.report.wording import inputs, percent, spoken, spoken_label
from porotwin_diagnosis.search.ranking import overall_misfit, score
from porotwin_diagnosis.thresholds import LEAST_RIVAL
from porotwin_solver.effects.definition import words
from porotwin_solver.service.effects_in_force import in_words


def write_report(path: Path, result: Diagnosis, summary: Summary) -> None:
    """Write the page on `result`, whose diagnosis.json holds `summary`, as one HTML file.

    The page needs no other file.
    """
    pages = Environment(
        loader=PackageLoader('porotwin_diagnosis', 'report'),
        autoescape=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )
    pages.filters.update(
        percent=percent,
        spoken=spoken,
        spoken_label=spoken_label,
        number=words.number,
        inputs=inputs,
    )
    findings, model = result.evidence.findings, result.verdict.model
    page = pages.get_template('page.html').render(
        result=result,
        summary=summary,
        errors=summary['error'],
        sample=result.samples[0],
        no_gap=result.verdict.name == NONE,
        unexplained=result.verdict.name == UNEXPLAINED,
        these=these(result),
        untried=findings.untried,
        rig=_rig_in_words(result.recordings[0].rig.name),
        recordings=list(_recordings(result)),
        sentence=sentence(result, summary),
        answer=answer(result, summary),
        where=_where_it_arises(result),
        by_recording=_by_recording(summary),
        figures=_figures(result),
        tried=sections.tried_effects(result, summary),
        without_row=sections.effects_without_row(result, summary),
        pairs=sections.tried_pairs(result, summary),
        phases=sections.phases(result),
        readings=list(sections.readings(result, summary)),
        checks=sections.laboratory_checks(result),
        experiments=sections.next_experiments(result, summary),
        compares=any(proposal['gain'] is not None for proposal in summary['next_experiment']),
        least_rival=LEAST_RIVAL,
        strengths=sections.visible_strengths(result),
        misfits=(score(findings.null), score(model), overall_misfit(*model.noise_misfit)),
        off_before=misplaced_fronts(result, findings.null),
        off_after=misplaced_fronts(result, model),
    )
    write_whole(path, page)


def _rig_in_words(name: str) -> str:
    return name if name.lower().endswith('rig') else f'{name} rig'


def _where_it_arises(result: Diagnosis) -> Picture | None:
    """Return the map of where the gap arises, if it has a place in the rig."""
    if not figures.arises_in_rig(result):
        return None
    return Picture.drawn(figures.where(result), _where_caption(result))


def _recordings(result: Diagnosis) -> Iterator[str]:
    """Say which recordings were diagnosed: duration, number of maps, cells, origin of the maps."""
    for recording, sample in zip(result.recordings, result.samples, strict=True):
        grid = recording.grid
        yield (
            f'{recording.source}: '
            f'{time_unit(sample.duration).text(sample.duration)}, '
            f'{len(recording.times)} maps of {grid.nx} × {grid.nz} cells of '
            f'{1e3 * grid.dx:.1f} mm, {recording.present_maps.origin.in_words}'
        )
    effects = result.recordings[0].rig.effects
    if effects:
        yield f'The model as it is has the effects of rig.yaml: {in_words(effects)}'


def _by_recording(summary: Summary) -> list[list[str]]:
    """Return the errors of each recording; empty for a single one."""
    parts = summary['by_recording']
    if len(parts) < 2:
        return []
    return [
        [
            part['recording'],
            *(percent(part[key]) for key in ('before', 'after', 'noise_floor')),
            closed(part),
        ]
        for part in parts
    ]


def _figures(result: Diagnosis) -> Iterator[Picture]:
    """Yield all figures; where the gap arises and the remainder are shown once."""
    yield from _photograph(result)
    for number, recording in enumerate(result.recordings):
        which = f' ({recording.source.name})' if len(result.recordings) > 1 else ''
        told = _plumes_caption(result, number, which)
        yield Picture.drawn(figures.plumes(result, number), told)
        if number == 0:
            yield Picture.drawn(figures.gap(result), _gap_caption(result))
        if number == 0 and result.verdict.name == UNEXPLAINED:
            yield Picture.drawn(figures.remainder(result), _remainder_caption(result))
        yield Picture.drawn(
            figures.course(result, number),
            f'Error over time{which}. The model runs from the start to the end without correction; '
            f'its input: {inputs(result.samples[number])}. Effects were fitted to the part before '
            'the shaded one and tested in the shaded one. Below: the rates, thick where tracer is '
            'injected.',
        )


def _photograph(result: Diagnosis) -> Iterator[Picture]:
    """Yield the last photograph, if the recording holds one that can be read."""
    photos = [photo for photo in result.recordings[0].photos if photo.role == 'state']
    if not photos:
        return
    try:
        picture = photograph(photos[-1].read(), result)
    except (OSError, ValueError, SyntaxError):  # all errors that a broken file raises
        return
    yield Picture.drawn(picture, caption(photos[-1].time, result), 'jpeg')


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
