"""The diagnosis as a whole: recordings in; a verdict, its evidence and pictures out."""

import json
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig, write_rig
from porotwin_diagnosis.advice.proposals import Proposal, propose
from porotwin_diagnosis.advice.strength import smallest_strengths
from porotwin_diagnosis.data.noise import noise_floor
from porotwin_diagnosis.data.noise_estimation import measure_point_spread_width
from porotwin_diagnosis.data.sample import Sample, read_sample
from porotwin_diagnosis.decision.held_out import HeldOut, worsened
from porotwin_diagnosis.decision.numerics import Numerics, before_and_after, judge_numerics
from porotwin_diagnosis.decision.verdict import NONE, UNEXPLAINED, Verdict, decide, refuted
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.gap_map import GapMap, map_gap
from porotwin_diagnosis.progress import Progress, forward_only
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json, write_fields
from porotwin_diagnosis.report.findings_json import write_findings
from porotwin_diagnosis.report.page import write_report
from porotwin_diagnosis.search.effect_search import search_effects
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.levels import TYPICAL_POINT_SPREAD, Levels
from porotwin_recording.recording import Recording, open_recording
from porotwin_solver.model import preset_named

FEWEST_COLUMNS, SCANT_CONFIDENCE = 80, 0.7
"""Columns of a recording below which no verdict is surer than this: on 47 columns a shifted picture
passed for a wrong rate, on 70 a wrong rate for unexplained."""

FEWEST_FITTED = 4
"""Frames with tracer to fit to below which the same holds."""


@dataclass(frozen=True)
class Diagnosis:
    """Everything a report needs; `summary` is the content of diagnosis.json."""

    recordings: tuple[Recording, ...]
    samples: tuple[Sample, ...]
    findings: Findings
    verdict: Verdict
    held_out: tuple[HeldOut, ...]
    gap: GapMap
    numerics: Numerics
    strengths: dict[str, dict[str, float | str]]
    proposals: tuple[Proposal, ...]
    summary: dict[str, Any]


def diagnose(
    recording: Path | str | Sequence[Path | str],
    output: Path | str,
    *,
    rig: Rig | Path | str | None = None,
    preset: str = 'accurate',
    excluded: Sequence[str] = (),
    apply: bool = False,
    workers: int = 2,
    progress: Progress = lambda _stage, _share: None,
) -> Diagnosis:
    """Diagnose one recording, or several of the same rig, and write the report into `output`.

    `rig` takes the place of the rig description in the recording. `preset` is the model whose gap
    is asked for; `excluded` names effects that are not considered. With `apply`, `output` also
    holds the rig description with the effects found, ready to be run by the twin.

    Raises:
        InputError: a recording cannot be read, or is too short to judge; or `output` cannot be
            written.
    """
    paths = [recording] if isinstance(recording, Path | str) else list(recording)
    began = time.perf_counter()
    preset_named(preset)  # complain before the long search
    opened = tuple(open_recording(path, rig=rig) for path in paths)
    _refuse_other_rigs(opened)
    folder = _report_folder(Path(output), paths)
    progress('reading the recording', 0.0)
    result = examine(opened, preset=preset, excluded=excluded, workers=workers, progress=progress)
    result.summary['made_with'] = {
        'preset': preset,
        'excluded': list(excluded),
        'simulations': result.findings.runs,
        'seconds': round(time.perf_counter() - began, 1),
    }
    progress('writing the report', 0.98)
    (folder / 'diagnosis.json').write_text(
        json.dumps(result.summary, indent=2, allow_nan=False) + '\n', encoding='utf-8'
    )
    parts = zip(opened, result.gap.each, result.held_out, strict=True)
    for number, (one, strength, part) in enumerate(parts, 1):
        name = 'fields.nc' if number == 1 else f'fields_{number}.nc'
        write_fields(folder / name, one.grid, strength, part)
    write_findings(folder / 'findings.json', result.findings)
    write_report(folder / 'report.html', result)
    if apply:
        write_rig(with_effects(opened[0].rig, result.verdict), folder / 'rig.yaml')
    progress('done', 1.0)
    return result


def _report_folder(output: Path, recordings: Sequence[Path | str]) -> Path:
    """Return the folder `output`, made if need be, before anybody waits for what goes there.

    Raises:
        InputError: it cannot be made, or is one of the `recordings`, whose files it would replace.
    """
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f'{output}: {error.strerror}; name another folder for the report'
        ) from error
    if not os.access(output, os.W_OK):
        raise InputError(f'{output}: cannot be written; name another folder for the report')
    if output.resolve() in {Path(recording).resolve() for recording in recordings}:
        raise InputError(f'{output}: is the recording; name another folder for the report')
    return output


def _refuse_other_rigs(recordings: Sequence[Recording]) -> None:
    first = recordings[0]
    for other in recordings[1:]:
        if other.rig.physics_fingerprint != first.rig.physics_fingerprint:
            raise InputError(
                f'{other.source}: its rig is not described as that of {first.source} is; judge '
                'each alone, or name the rig.yaml that holds for all with --rig'
            )


def with_effects(rig: Rig, verdict: Verdict) -> Rig:
    """Return `rig` with the effects that `verdict` names; unchanged where it names none."""
    if not verdict.members:
        return rig
    return rig.model_copy(update={'effects': (*rig.effects, *verdict.model.effects)})


def examine(
    recordings: Sequence[Recording],
    *,
    preset: str = 'accurate',
    excluded: Sequence[str] = (),
    workers: int = 2,
    progress: Progress = lambda _stage, _share: None,
) -> Diagnosis:
    """Return the diagnosis of `recordings` without writing anything; see `diagnose`."""
    progress = forward_only(progress)
    samples = tuple(read_sample(recording) for recording in recordings)
    gap = map_gap(*recordings, preset='fast' if preset == 'accurate' else preset)
    findings, levels = search_effects(
        samples, excluded=excluded, workers=workers, progress=progress
    )
    verdict = _no_surer_than_seen(decide(findings), samples)
    progress('measuring intervals', 0.92)
    verdict = replace(verdict, model=_with_interval(levels, verdict.model))
    singles = [
        _with_interval(levels, fit) if fit.members[0].effect in verdict.inseparable else fit
        for fit in findings.singles
    ]
    findings = replace(findings, singles=singles)
    numerics = judge_numerics(samples, findings, verdict, preset=preset)
    verdict = numerics.amended(verdict)
    held_out = _held_out(recordings, samples, verdict, numerics)
    if verdict.members and worsened(held_out):
        verdict = refuted(verdict)
        held_out = _held_out(recordings, samples, verdict, numerics)
    progress('looking for experiments that would tell more', 0.95)
    if verdict.name == NONE:
        gap = gap.without_places()
    strengths = smallest_strengths(levels.screening)
    proposals = propose(levels.screening, findings, verdict, progress=progress)
    parts: dict[str, Any] = {
        'recordings': tuple(recordings),
        'samples': samples,
        'findings': findings,
        'verdict': verdict,
        'held_out': held_out,
        'gap': gap,
        'numerics': numerics,
        'strengths': strengths,
        'proposals': proposals,
    }
    result = Diagnosis(**parts, summary={})
    return replace(result, summary=diagnosis_json(result))


def _no_surer_than_seen(verdict: Verdict, samples: Sequence[Sample]) -> Verdict:
    """Return `verdict`, less sure where the cells of all recordings are too large to tell, or where
    few frames show the tracer before the part that no fit sees."""
    fitted = sum(sample.fitted_frames for sample in samples)
    if fitted >= FEWEST_FITTED and max(s.grid.nx for s in samples) >= FEWEST_COLUMNS:
        return verdict
    return replace(verdict, confidence=min(verdict.confidence, SCANT_CONFIDENCE))


def _with_interval(levels: Levels, model: Fit) -> Fit:
    """Return `model` with the covariance of its scaled and what another resolution changes."""
    if not model.members:
        return model
    fitter = levels.refining
    refined = fitter.with_covariance(model)
    again = fitter.fit(model.members, start=model.scaled_parameters, coarse_steps=0, fine_steps=1)
    shift = again.scaled_parameters - model.scaled_parameters
    return replace(model, covariance=refined.covariance + np.diag(shift**2))


def _held_out(
    recordings: Sequence[Recording],
    samples: Sequence[Sample],
    verdict: Verdict,
    numerics: Numerics,
) -> tuple[HeldOut, ...]:
    return tuple(
        _held_out_of(recording, sample, verdict, numerics)
        for recording, sample in zip(recordings, samples, strict=True)
    )


def _held_out_of(
    recording: Recording, sample: Sample, verdict: Verdict, numerics: Numerics
) -> HeldOut:
    """Return the held-out part with and without the verdict's model.

    Beside a wrong model the edge blur would be that of its misplaced fronts, and is not measured.
    """
    chosen = np.flatnonzero(recording.times >= sample.held_out_start)
    observed = recording.concentration[chosen].astype(float)
    part = replace(sample, times=recording.times[chosen], observed=observed, fitted_frames=0)
    before, after = before_and_after(part, verdict.model, numerics)
    wrong = verdict.name == UNEXPLAINED
    width = (
        TYPICAL_POINT_SPREAD if wrong else measure_point_spread_width(observed, after, sample.noise)
    )
    floor = noise_floor(replace(sample.noise, point_spread_width=width), after, observed)
    return HeldOut(
        recording.times[chosen],
        observed,
        before,
        after,
        part.relative_error(before),
        part.relative_error(after),
        floor,
        width,
    )
