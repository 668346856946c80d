"""The report for an experimenter: the answer, pictures and evidence on one page, `page.html`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from porotwin_core.basis.whole_file import write_whole
from porotwin_core.clock.time_units import time_unit
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.report import figures
from porotwin_diagnosis.report import report_sections as sections
from porotwin_diagnosis.report.answer import Summary, answer_of, misplaced_fronts
from porotwin_diagnosis.report.photograph_figure import gap_has_a_place, photograph
from porotwin_diagnosis.report.picture import Picture
from porotwin_diagnosis.report.templates import TEMPLATES, said
from porotwin_diagnosis.search.ranking import overall_misfit, score


def write_report(path: Path, result: Diagnosis, summary: Summary) -> None:
    """Write the page on `result`, whose diagnosis.json holds `summary`, as one HTML file.

    The page needs no other file.
    """
    findings, model = result.evidence.findings, result.verdict.model
    page = TEMPLATES.get_template('page.html').render(
        result=result,
        summary=summary,
        errors=summary['error'],
        sample=result.samples[0],
        rig=result.recordings[0].rig,
        time_unit=time_unit,
        unit=time_unit(result.samples[0].duration),
        no_gap=result.verdict.name == NONE,
        unexplained=result.verdict.name == UNEXPLAINED,
        untried=findings.untried,
        answer=answer_of(result, summary),
        where=_where_it_arises(result),
        figures=_figures(result),
        tried=sections.tried_effects(result, summary),
        without_row=sections.effects_without_row(result, summary),
        sets=sections.tried_sets(result, summary),
        checks=sections.laboratory_checks(result),
        misfits=(score(findings.null), score(model), overall_misfit(*model.noise_misfit)),
        off_before=misplaced_fronts(result, findings.null),
        off_after=misplaced_fronts(result, model),
    )
    write_whole(path, page)


def _where_it_arises(result: Diagnosis) -> Picture | None:
    """Return the map of where the gap arises, if it has a place in the rig."""
    if not figures.arises_in_rig(result):
        return None
    return Picture.drawn(figures.where(result), caption(result, 'where', 0))


def _figures(result: Diagnosis) -> Iterator[Picture]:
    """Yield all figures; where the gap arises and the remainder are shown once."""
    yield from _photograph(result)
    for number in range(len(result.recordings)):
        yield Picture.drawn(figures.plumes(result, number), caption(result, 'plumes', number))
        if number == 0:
            yield Picture.drawn(figures.gap(result), caption(result, 'gap', 0))
        if number == 0 and result.verdict.name == UNEXPLAINED:
            yield Picture.drawn(figures.remainder(result), caption(result, 'remainder', 0))
        yield Picture.drawn(figures.course(result, number), caption(result, 'course', number))


def _photograph(result: Diagnosis) -> Iterator[Picture]:
    """Yield the last photograph, if the recording holds one that can be read."""
    photos = [photo for photo in result.recordings[0].photos if photo.role == 'state']
    if not photos:
        return
    try:
        picture = photograph(photos[-1].read(), result)
    except (OSError, ValueError, SyntaxError):  # all errors that a broken file raises
        return
    yield Picture.drawn(picture, caption(result, 'photograph', 0, photo=photos[-1]), 'jpeg')


def caption(result: Diagnosis, part: str, number: int, **facts: Any) -> str:
    """Return the caption `part` of `captions.txt.j2` for a recording; `facts` are further ones."""
    recording, sample, verdict = result.recordings[number], result.samples[number], result.verdict
    effects = verdict.model.effects
    is_placed = any({'x', 'well'} & set(effect.parameters) for effect in effects)
    facts |= {
        'verdict': verdict,
        'name': recording.source.name if len(result.recordings) > 1 else '',
        'sample': sample,
        'is_tall': figures.is_tall(recording.rig),
        'arises_in_rig': figures.arises_in_rig(result),
        'is_marked': is_placed and bool(verdict.members),
        'noise': overall_misfit(*verdict.model.noise_misfit),
        'unit': time_unit(sample.duration),
        'is_drawn_upon': recording.rig.camera is not None,
        'gap_has_a_place': gap_has_a_place(result),
    }
    return said('captions.txt.j2', part, facts)
