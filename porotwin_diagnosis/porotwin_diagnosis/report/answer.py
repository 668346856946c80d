"""The first screen of the report: cause, place, size and confidence.

`AnswerFacts` are the facts, `answer.txt.j2` says them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from porotwin_core.rig import Rig
from porotwin_diagnosis.advice.partial_cause import is_dipole
from porotwin_diagnosis.advice.remainder_form import RemainderForm
from porotwin_diagnosis.data.error_parts import ErrorParts
from porotwin_diagnosis.data.sample import FRONT_TOLERANCE
from porotwin_diagnosis.decision.compared_readings import ComparedReading
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.held_out import (
    camera_errors,
    remaining_parts,
    root_mean_square,
)
from porotwin_diagnosis.decision.verdict import UNEXPLAINED, Verdict
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.gap_map import Spot
from porotwin_diagnosis.report.named_rows import named_rows
from porotwin_diagnosis.report.templates import said
from porotwin_diagnosis.report.wording import interval, origin
from porotwin_diagnosis.search.ranking import misfit_beyond_noise, swallowed_misfit
from porotwin_diagnosis.thresholds import NO_GAP_MISFIT, OPEN_CONFIDENCE
from porotwin_solver.effects import EFFECTS

MORE_THAN_NOISE = 1.3
"""Error over the noise floor above which more than noise and blur is left."""

NEARLY_ALL = 0.8
"""Least share of an unexplained gap that nearly explains it, if effects of the library close it."""

NO_FRONTS = 0.5
"""Error of a model from which on it has no fronts near the observed ones [-]."""

Summary = Mapping[str, Any]
"""The content of diagnosis.json, or a part of it."""

Point = tuple[float, float]
"""A place x, z [m], rounded to the millimetre as it is stated."""


class ActingPlace(NamedTuple):
    """Where an effect acts.

    Attributes:
        kind: `camera`, `model`, `point`, `well`, or `rig` for the whole one.
        point: the place of the effect, or of its well.
        well: name of its well.
        opens: where the well really opens; None: at `point`.
    """

    kind: str
    point: Point | None = None
    well: str = ''
    opens: Point | None = None


class Improvement(NamedTuple):
    """How far the error falls with the named effects.

    Attributes:
        seen_in: where it falls: in the held-out `maps`, in those with the blur of the `camera`, or
            `camera and level` of the maps, in the `fitted part`, or in the `readings`.
        before, after: the error there [-]; of readings in standard deviations.
        held_out: the same of the held-out maps with the blur of the camera; None: not needed.
    """

    seen_in: str
    before: float
    after: float
    held_out: tuple[float, float] | None = None


class FittedParameter(NamedTuple):
    """A parameter with value and 90 % interval (empty: unknown), as texts with their unit.

    `effect` is empty if there is no other one.
    """

    effect: str
    name: str
    value: str
    interval: str


@dataclass(frozen=True)
class Named:
    """The facts of an answer that names effects. A row is one of `effects` in diagnosis.json.

    Attributes:
        same: other sets of effects that look the same.
        rows: rows of the members.
        alternatives: rows of the effects of each alternative, jointly fitted if they were.
        others: rows of the effects that look the same as the first member; empty for alternatives.
        described: members that rig.yaml describes already: its values may be wrong instead.
        improvement: how far the error falls.
        places: names of members and others, and where they act.
        common_place: the place, if it is the same for all.
    """

    same: Sequence[tuple[str, ...]]
    rows: list[Summary]
    alternatives: list[list[Summary]]
    others: list[Summary]
    described: list[str]
    improvement: Improvement
    places: list[tuple[str, ActingPlace]]
    common_place: ActingPlace | None


@dataclass(frozen=True)
class Unexplained:
    """The facts of an unexplained gap.

    Attributes:
        form: the form of the gap; None if it has none.
        part: effects that close a part of the gap, as `beside` in diagnosis.json; None: there are
            none.
        part_closes: share of the gap that they close, 1 at most.
        part_fits: whether the form of the rest beside them fits well.
        is_dipole: whether they are a source beside an equally strong sink.
        nearest: what comes nearest to an explanation: the `form`, the `part`, or `nothing`.
        says_form: whether the form is stated as a cause; not where the part closes more.
        is_nearly_known: whether the part closes nearly all of the gap.
        tried: number of effects that were tried.
        best: label of the best model.
        fronts_off: how far its fronts are off [m]; None if it has none near the observed ones.
        spot: the place where most of the gap arises; None if no place stands out.
    """

    form: RemainderForm | None
    part: Summary | None
    part_closes: float
    part_fits: bool
    is_dipole: bool
    nearest: str
    says_form: bool
    is_nearly_known: bool
    tried: int
    best: str
    fronts_off: float | None
    spot: Spot | None


@dataclass(frozen=True)
class AnswerFacts:
    """The facts of the first screen.

    Attributes:
        verdict, evidence: the verdict, and what it was made from.
        summary: the content of diagnosis.json.
        named, unexplained: what belongs to such a verdict; else None.
        parameters: the fitted parameters of the named effects.
        remaining: parts of the error that remains; None where they were not measured.
        several: whether there are several recordings.
        calibrated: whether a recording has maps from photographs, with a calibration.
        is_open: whether the confidence is that of an open question.
        is_local: whether the error of the whole held-out part is one of noise and blur.
        leaves_more: whether the error is clearly larger than that of noise and blur.
        believed: effects that earlier recordings make most probable.
        paling: members that a calibration by a core takes a part of.
        swallowed: misfit that only the errors that all maps share explain, if it makes a gap; or 0.
    """

    verdict: Verdict
    evidence: Evidence
    summary: Summary
    named: Named | None
    unexplained: Unexplained | None
    parameters: list[FittedParameter]
    remaining: ErrorParts | None
    several: bool
    calibrated: bool
    is_open: bool
    is_local: bool
    leaves_more: bool
    believed: list[str]
    paling: list[str]
    swallowed: float

    def said(self, part: str) -> str:
        """Return the lines of a `part`: sentence, cause, where, how_much or how_sure."""
        return said('answer.txt.j2', part, vars(self))


def sentence(result: Diagnosis, summary: Summary) -> str:
    """Return the verdict on `result` in one or two sentences; the **effects** are marked.

    The verdict of a search that was ended is preliminary.
    """
    return answer_of(result, summary).said('sentence')


def answer_of(result: Diagnosis, summary: Summary) -> AnswerFacts:
    """Return the facts of the answer on `result`, whose diagnosis.json holds `summary`."""
    verdict, errors, belief = result.verdict, summary['error'], summary['belief'] or {}
    stored = [recording.maps for recording in result.recordings]
    calibrated = any(maps is not None and bool(maps.origin.calibrated) for maps in stored)
    is_unexplained, swallowed = verdict.name == UNEXPLAINED, swallowed_misfit(verdict.model)
    likely = 0.99 * max(belief.values(), default=0.0)
    return AnswerFacts(
        verdict=verdict,
        evidence=result.evidence,
        summary=summary,
        named=_named(result, summary) if verdict.kept else None,
        unexplained=_unexplained(result, summary) if is_unexplained else None,
        parameters=list(_parameters(verdict, summary)),
        remaining=remaining_parts(result.held_out),
        several=len(result.recordings) > 1,
        calibrated=calibrated,
        is_open=verdict.confidence <= OPEN_CONFIDENCE,
        is_local=errors['before'] <= errors['noise_floor'],
        leaves_more=errors['before'] > MORE_THAN_NOISE * errors['noise_floor'],
        believed=[name for name, share in belief.items() if share > likely],
        paling=[name for name in verdict.members if calibrated and EFFECTS[name].pales_core],
        swallowed=swallowed if swallowed > NO_GAP_MISFIT and not is_unexplained else 0.0,
    )


def _named(result: Diagnosis, summary: Summary) -> Named:
    verdict, rig = result.verdict, result.recordings[0].rig
    members, described = verdict.members, {effect.name for effect in rig.effects}
    inseparable = () if verdict.alternatives else verdict.not_separable
    names = (*members, *inseparable)
    rows = named_rows(summary, names)
    own = [[name for name in names if name not in members] for names in verdict.alternatives]
    together = zip(own, summary['alternative_effects'], strict=True)
    places = [_place(name, row, rig) for name, row in zip(names, rows, strict=True)]
    return Named(
        same=verdict.alternatives or [(name, *members[1:]) for name in inseparable],
        rows=rows[: len(members)],
        alternatives=[joint or named_rows(summary, alone) for alone, joint in together],
        others=rows[len(members) :],
        described=[name for name in members if name in described],
        improvement=_improvement(result, summary['error']),
        places=list(zip(names, places, strict=True)),
        common_place=places[0] if len(set(places)) == 1 else None,
    )


def _place(name: str, row: Summary, rig: Rig) -> ActingPlace:
    """Return where the effect `name` acts, with the parameters of its `row`."""
    if origin(name) != 'rig':
        return ActingPlace(origin(name))
    values = {key: entry['value'] for key, entry in row['parameters'].items()}
    if EFFECTS[name].has_place:
        return ActingPlace('point', _point(values['x'], values['z']))
    if 'well' not in values:
        return ActingPlace('rig')
    well = rig.wells[values['well']]
    moved = {'dx', 'dz'} <= values.keys()
    opens = _point(well.x_m + values['dx'], well.z_m + values['dz']) if moved else None
    return ActingPlace('well', _point(well.x_m, well.z_m), values['well'], opens)


def _point(x: float, z: float) -> Point:
    return round(x, 3), round(z, 3)


def _improvement(result: Diagnosis, errors: Mapping[str, float]) -> Improvement:
    """Return where the error falls: not always in the plain error of the held-out part."""
    if errors['after'] < errors['before']:
        return Improvement('maps', errors['before'], errors['after'])
    seen = camera_errors(result.held_out)
    if seen[1] < seen[0]:
        level = '' if result.held_out[0].level_known else ' and level'
        return Improvement(f'camera{level}', *seen)
    before = result.evidence.findings.null.fitted_error
    after = result.verdict.model.fitted_error
    if after < before or not result.readings:
        return Improvement('fitted part', before, after, seen)
    before, after = map(root_mean_square, zip(*map(_off, result.readings), strict=True))
    return Improvement('readings', before, after)


def _off(one: ComparedReading) -> tuple[float, float]:
    """Return how far a reading lies off the model before and after [standard deviations]."""
    read = one.reading
    return (read.value - one.before) / read.deviation, (read.value - one.after) / read.deviation


def _unexplained(result: Diagnosis, summary: Summary) -> Unexplained:
    findings, model, partial = result.evidence.findings, result.verdict.model, result.partial
    form = result.remainder if result.remainder and result.remainder.terms else None
    part = summary['remainder'] and summary['remainder']['beside']
    part_closes = min(part['gap_closed'], 1.0) if part else 0.0
    form_closes = form.closed if form else 0.0
    nearest = 'form' if form_closes > part_closes else 'part'
    width, spots = result.samples[0].grid.width, result.gap.spots
    has_fronts = summary['error']['after'] < NO_FRONTS
    return Unexplained(
        form=form,
        part=part,
        part_closes=part_closes,
        part_fits=partial is not None and partial.form.fits_well,
        is_dipole=partial is not None and is_dipole(partial.model.effects, width),
        nearest=nearest if part else 'nothing',
        says_form=part_closes <= form_closes,
        is_nearly_known=part_closes > NEARLY_ALL,
        tried=len({fit.members[0].effect for fit in findings.screened}),
        best=model.label,
        fronts_off=misplaced_fronts(result, model) if has_fronts else None,
        spot=spots[0] if spots else None,
    )


def misplaced_fronts(result: Diagnosis, fit: Fit) -> float:
    """Return the shift of fronts [m] that would make the misfit of `fit` beyond the noise."""
    return max(misfit_beyond_noise(fit)) * FRONT_TOLERANCE * result.samples[0].grid.dx


def _parameters(verdict: Verdict, summary: Summary) -> Iterator[FittedParameter]:
    """Yield the parameters of the named effects.

    Those of inseparable effects come too, but not beside a pair: they were fitted alone.
    """
    named = verdict.members
    if len(named) == 1:
        named = (*named, *verdict.not_separable)
    rows = [row for row in summary['effects'] if row['name'] in named]
    for row in rows:
        effect = row['name']
        for name, entry in row['parameters'].items():
            is_fixed = EFFECTS[effect].parameters[name].may_be_fixed and entry['low'] is None
            if not is_fixed:
                only = '' if len(rows) == 1 else effect
                yield FittedParameter(only, name, *interval(effect, name, entry))
