"""The whole diagnosis: from recordings to a verdict with its evidence. It writes no files.

    diagnosis = examine([open_recording('runs/monday')])
    print(diagnosis.verdict.name, diagnosis.verdict.confidence)

`report.report_folder.write_diagnosis` writes the report.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from porotwin_checks.all_checks import OF_MAPS, OF_RIG, OF_TABLES
from porotwin_core.basis.blas_threads import one_blas_thread
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.parallel import Crew
from porotwin_core.basis.units import percent
from porotwin_diagnosis.advice.partial_cause import form_model, partial_cause
from porotwin_diagnosis.advice.proposals import Proposal, propose, tell_kinds_apart
from porotwin_diagnosis.advice.remainder_form import describe_remainder
from porotwin_diagnosis.advice.strength import smallest_strengths
from porotwin_diagnosis.data.false_cells import without_false_cells
from porotwin_diagnosis.data.fewer_cells import with_fewer_cells
from porotwin_diagnosis.data.odd_heads import odd_heads
from porotwin_diagnosis.data.sample import Sample
from porotwin_diagnosis.decision.compared_readings import compared_readings
from porotwin_diagnosis.decision.evidence import Evidence, gather
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.held_out import HeldOut, measure_held_out
from porotwin_diagnosis.decision.intervals import with_intervals
from porotwin_diagnosis.decision.numerics import ACCURATE, Numerics, measure_numerics
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Verdict
from porotwin_diagnosis.decision.verdict_rules import decide
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.gap_map import map_gap
from porotwin_diagnosis.model.unknown_rates import SourceRate, beside_the_rates, settled
from porotwin_diagnosis.progress import Progress, forward_only, no_progress
from porotwin_diagnosis.search.effect_search import SearchStep, search_effects
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import TYPICAL_POINT_SPREAD, Levels
from porotwin_diagnosis.search.prior import NO_PRIOR, Prior
from porotwin_diagnosis.search.ranking import score
from porotwin_recording.experiment.recording import Recording, odd_lines
from porotwin_solver.model.model import preset_named
from porotwin_solver.service.effects_in_force import in_words

SIMULATION_BYTES = 3e8
"""Memory of a simulation on the finest cells of a diagnosis, with its comparison [B]."""


@dataclass(frozen=True)
class DiagnosisSettings:
    """How recordings are diagnosed, and who hears of it.

    Attributes:
        preset: preset of the solver whose gap is diagnosed.
        excluded: names of effects to leave out.
        prior: the belief that earlier recordings of this rig have left.
        crew: runs the simulations; None: one at a time.
        progress: called with the stage and its position in the work, below 0.98.
        tell: called with a line for all that is odd in their rates and maps, before the search, and
            for every rate that nobody measured, after it.
        so_far: called with a line about the best effects so far, whenever the search finds others.
        ended: asked before every simulation of the search. Once it is true, the search ends, and
            the result is the answer so far.
    """

    preset: str = ACCURATE
    excluded: Sequence[str] = ()
    prior: Prior = NO_PRIOR
    crew: Crew | None = None
    progress: Progress = no_progress
    tell: Callable[[str], None] = lambda _line: None
    so_far: Callable[[str], None] = lambda _line: None
    ended: Callable[[], bool] = lambda: False


@one_blas_thread()
def examine(
    recordings: Sequence[Recording], settings: DiagnosisSettings = DiagnosisSettings()
) -> Diagnosis:
    """Diagnose one recording, or several of the same rig together.

    Args:
        recordings: at least one recording; an effect has the same size in all of them.
        settings: how, and who hears of it.

    Raises:
        InputError: the preset is unknown, the recordings describe different rigs, or a recording
            is too short to judge.
        CancelledError: the search was ended before it fitted the first effect.
    """
    began = time.perf_counter()
    preset_named(settings.preset)
    _check_same_rig(recordings)
    settings = replace(settings, progress=forward_only(settings.progress))
    excluded, progress, tell = settings.excluded, settings.progress, settings.tell
    progress('reading the recording', 0.0)
    odd = odd_lines(recordings, OF_MAPS | OF_RIG)
    for line in odd:  # opening them told the others
        tell(line)
    averaged: list[str] = []
    recordings = [
        with_fewer_cells(without_false_cells(recording), averaged.append)
        for recording in recordings
    ]
    for line in averaged:
        tell(line)
    judged = judge(recordings, settings)
    for line in judged.unmeasured:
        tell(line)
    recordings, samples, verdict = judged.recordings, judged.samples, judged.verdict
    findings, levels = judged.evidence.findings, judged.levels
    gap = map_gap(*recordings, preset='fast' if settings.preset == ACCURATE else settings.preset)
    held_out = _as_judged(judged.held_out, samples, verdict)
    found = recordings[0].rig.with_effects(verdict.model.effects)
    unexplained = verdict.name == UNEXPLAINED
    next_stage = 'describing the gap' if unexplained else 'looking for experiments that show more'
    progress(next_stage, 0.95)
    screening = levels.screening
    remainder, partial = None, None
    proposals: tuple[Proposal, ...] = ()
    if findings.untried:
        pass  # the next step is to try it
    elif unexplained:
        remainder = describe_remainder(form_model(levels), excluded=excluded, pool=levels.pool)
        partial = partial_cause(recordings, levels, verdict.model, held_out, excluded=excluded)
        proposals = tell_kinds_apart(remainder, samples[0])
    else:
        proposals = propose(screening, findings, verdict, progress=progress)
    return Diagnosis(
        recordings=tuple(recordings),
        samples=samples,
        evidence=judged.evidence,
        verdict=verdict,
        held_out=held_out,
        gap=gap.without_places() if verdict.name == NONE else gap,
        strengths=smallest_strengths(screening),
        proposals=proposals,
        excluded=tuple(excluded),
        remainder=remainder,
        partial=partial,
        rates=judged.rates,
        readings=compared_readings(samples, verdict.model.effects, settings.crew),
        remarks=(
            *judged.unmeasured,
            *untried_lines(findings),
            *odd_lines(recordings, OF_TABLES),
            *odd,
            *averaged,
            *(line for line in odd_heads(found) if not any(line in told for told in odd)),
        ),
        seconds=time.perf_counter() - began,
    )


class Judged(NamedTuple):
    """A verdict with all that it was made from.

    Attributes:
        recordings: the recordings, at the rates that nobody measured.
        samples: the frames of each recording that were compared.
        levels: the levels of the search, with the corrections that were last in use.
        evidence: all fits and measures that the verdict was made from.
        held_out: the held-out part of each recording.
        verdict: the verdict.
        rates: the rates of sources that nobody measured.
        unmeasured: a line on each of them.
    """

    recordings: tuple[Recording, ...]
    samples: tuple[Sample, ...]
    levels: Levels
    evidence: Evidence
    held_out: tuple[HeldOut, ...]
    verdict: Verdict
    rates: tuple[SourceRate, ...]
    unmeasured: tuple[str, ...]


def judge(
    recordings: Sequence[Recording], settings: DiagnosisSettings = DiagnosisSettings()
) -> Judged:
    """Search for effects, and make the verdict, as `examine` does.

    Raises:
        InputError: a recording is too short to judge.
        CancelledError: as `examine`.
    """
    start = settled(recordings, crew=settings.crew)
    recordings, samples = tuple(start.recordings), start.samples
    levels, findings = search_effects(
        samples,
        excluded=settings.excluded,
        prior=settings.prior,
        crew=settings.crew,
        progress=settings.progress,
        so_far=_Told(samples, settings.so_far),
        ended=settings.ended,
    )
    settings.progress('measuring intervals', 0.92)
    findings, explanation = with_intervals(levels.refining, findings, explain(findings))
    numerics = measure_numerics(samples, findings.null, explanation.model, preset=settings.preset)
    joint, rates = start.sources.beside(explanation.model)
    explanation = replace(explanation, model=beside_the_rates(explanation.model, joint))
    held_out = tuple(
        measure_held_out(recording, sample, joint, numerics, settings.crew)
        for recording, sample in zip(recordings, samples, strict=True)
    )
    evidence = gather(samples, findings, explanation, numerics)
    return Judged(
        recordings,
        samples,
        levels,
        evidence,
        held_out,
        decide(evidence),
        tuple(rates),
        tuple(start.told(rates)),
    )


class _Told:
    """Tells the best effects so far, with the confidence in them: others, or on finer cells."""

    def __init__(self, samples: Sequence[Sample], tell: Callable[[str], None]) -> None:
        self._samples, self._tell = samples, tell
        self._before: tuple[str, bool] | None = None

    def __call__(self, step: SearchStep) -> None:
        """Tell the findings of `step`, judged by the rules of a whole search."""
        news = step.best.label, step.is_coarse
        if news == self._before:
            return
        self._before = news
        judged = step.completed()
        findings, null, best = judged.findings, judged.findings.null, judged.best
        explanation = explain(findings)
        numerics = Numerics(ACCURATE, score(null), score(null))
        verdict = decide(gather(self._samples, findings, explanation, numerics))
        named = in_words(verdict.model.effects) if verdict.kept else verdict.name
        before, after = (percent(fit.held_out_error) for fit in (null, best))
        error = f'{before} to {after}'
        nearest = '' if verdict.kept else f'; nearest: {in_words(best.effects)}'
        if not verdict.kept and best.held_out_error >= null.held_out_error:
            nearest, error = '', before  # it makes the error larger
        self._tell(
            f'so far: {named}, confidence {percent(verdict.confidence)}{nearest}; error of the '
            f'held-out maps {error}, on the cells of this stage'
        )


def untried_lines(findings: Findings) -> list[str]:
    """Return a line if the search was ended: another answer may have come."""
    if not findings.untried:
        return []
    return [
        f'the search was ended before it tried {findings.untried}; ./porotwin diagnose that is '
        'neither quick nor interrupted tries all'
    ]


def _check_same_rig(recordings: Sequence[Recording]) -> None:
    """Raise `InputError` if `recordings` describe different rigs."""
    first, *others = recordings
    for other in others:
        if other.rig.physics_fingerprint != first.rig.physics_fingerprint:
            raise InputError(
                f'{other.source}: its rig is not described as the rig of {first.source} is; '
                'diagnose each alone, or name the rig.yaml that holds for all with --rig'
            )


def _as_judged(
    held_out: Sequence[HeldOut], samples: Sequence[Sample], verdict: Verdict
) -> tuple[HeldOut, ...]:
    """Return the held-out parts with the point spread and the noise floor that suit `verdict`.

    A point spread measured with a wrong model comes from its misplaced fronts. Where the gap is
    unexplained, the usual point spread of a camera is assumed instead.
    """
    if verdict.name != UNEXPLAINED:
        return tuple(held_out)
    return tuple(
        part.assuming_point_spread(TYPICAL_POINT_SPREAD, sample.noise)
        for part, sample in zip(held_out, samples, strict=True)
    )
