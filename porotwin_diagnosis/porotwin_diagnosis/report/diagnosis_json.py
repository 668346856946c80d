"""The content of diagnosis.json: a diagnosis for programs (diagnosis contract)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

from porotwin_diagnosis.advice.cause import Place
from porotwin_diagnosis.advice.proposals import Proposal
from porotwin_diagnosis.advice.remainder_form import RemainderForm
from porotwin_diagnosis.decision.compared_readings import ComparedReading
from porotwin_diagnosis.decision.held_out import (
    HeldOut,
    gap_closed,
    gap_closed_with_interval,
    remaining_parts,
    root_mean_square,
)
from porotwin_diagnosis.decision.probabilities import stated_probabilities
from porotwin_diagnosis.decision.verdict import NUMERICAL
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.gap_map import Phase, Spot
from porotwin_diagnosis.report.named_rows import occurrence, with_occurrences
from porotwin_diagnosis.report.origin import origin_of
from porotwin_diagnosis.report.templates import said
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import overall_misfit, score
from porotwin_diagnosis.thresholds import INTERVAL_DEVIATIONS
from porotwin_solver.effects import EFFECTS

MODEL_DIFFUSION_RANGE = (0.5, 2.0)
"""Interval of the equivalent numerical diffusion, relative to its value: different fronts give
different values."""


class Errors(NamedTuple):
    """Errors [-] of the held-out part, rounded as they are stated.

    `noise_floor`, `before` and `after` are relative L2 norms: of noise and blur alone, and of the
    model before and after. `gap_closed` is the share of the gap above the noise floor that closes;
    `gap_closed_low` to `gap_closed_high` is its 90 % interval.
    """

    noise_floor: float
    before: float
    after: float
    gap_closed: float
    gap_closed_low: float
    gap_closed_high: float


def diagnosis_json(result: Diagnosis) -> dict[str, Any]:
    """Return the content of diagnosis.json for `result`."""
    verdict, findings = result.verdict, result.evidence.findings
    noise, held_out = result.samples[0].noise, result.held_out
    return {
        'schema': 1,
        'verdict': verdict.name,
        'confidence': round(verdict.confidence, 3),
        'doubt': said('doubt.txt.j2', 'doubt', {'verdict': verdict, 'evidence': result.evidence}),
        'untried': findings.untried,
        'not_separable_from': list(verdict.not_separable),
        'combination': list(verdict.members) if verdict.kept else [],
        'combination_alternatives': [list(names) for names in verdict.alternatives],
        'alternative_effects': [_joint_rows(result, names) for names in verdict.alternatives],
        'effects': _effects(result),
        'error': errors_of(held_out)._asdict(),
        'remaining': _remaining(held_out),
        'where': {
            'centre': _centre(result),
            'hot_spots': [_spot(spot) for spot in result.gap.spots],
        },
        'when': [_phase(phase, result) for phase in result.gap.phases],
        'held_out': {'start_s': float(held_out[0].times[0]), 'end_s': result.samples[0].end},
        'misfit': {
            'before': round(score(findings.null), 3),
            'after': round(score(verdict.model), 3),
            'noise': round(overall_misfit(*verdict.model.noise_misfit), 3),
            'unit': 'standard deviations at fronts, of noise and of a front 0.12 cells off',
        },
        'noise': {
            'grain': round(noise.grain, 4),
            'frame': round(noise.frame, 4),
            'background': round(noise.background, 4),
            'correlation_cells': round(noise.correlation, 2),
            'blur_cells': round(held_out[0].point_spread_width, 2),
            'shared_errors': _shared_errors(result),
        },
        'smallest_visible': {
            name: strength._asdict() for name, strength in result.strengths.items()
        },
        'next_experiment': [_proposal(proposal) for proposal in result.proposals],
        'remainder': _remainder(result),
        'belief': _belief(result),
        'history': [],
        'rates': [asdict(rate) for rate in result.rates],
        'readings': [_reading(one) for one in result.readings],
        'remarks': list(result.remarks),
        'recordings': [str(recording.source) for recording in result.recordings],
        'by_recording': _by_recording(result),
        'made_with': {
            'preset': result.evidence.numerics.preset,
            'excluded': list(result.excluded),
            'simulations': findings.runs,
            'seconds': round(result.seconds, 1),
            'read': [origin_of(recording) for recording in result.recordings],
        },
    }


def _reading(one: ComparedReading) -> dict[str, Any]:
    """Return a reading in the units of observations.csv, beside the model."""
    read, unit = one.reading, one.reading.kind.per_si
    numbers = {
        'measured': read.value, 'deviation': read.deviation,
        'before': one.before, 'after': one.after,
    }  # fmt: skip
    where = {'time_s': read.time, 'kind': str(read.kind), 'place': read.where}
    return {**where, **{name: float(f'{unit * value:.6g}') for name, value in numbers.items()}}


def _remaining(held_out: Sequence[HeldOut]) -> dict[str, float] | None:
    """Return the parts of the error that remains; None where they were not measured."""
    parts = remaining_parts(held_out)
    return None if parts is None else {name: round(one, 5) for name, one in asdict(parts).items()}


def _belief(result: Diagnosis) -> dict[str, float] | None:
    """Return the belief that earlier recordings left; None without any."""
    believed = result.evidence.findings.prior.probabilities
    return {name: round(share, 4) for name, share in believed.items()} or None


def _remainder(result: Diagnosis) -> dict[str, Any] | None:
    """Return the form of an unexplained gap; None for other verdicts."""
    form = result.remainder
    if form is None:
        return None
    return {
        'kind': form.kind,
        'closed': round(form.closed, 3),
        'terms': _terms(form),
        'beside': _beside(result),
    }


def _beside(result: Diagnosis) -> dict[str, Any] | None:
    """Return the effects that close much of an unexplained gap, and the remainder."""
    partial = result.partial
    if partial is None:
        return None
    numbered = with_occurrences([member.effect for member in partial.model.members])
    return {
        'effects': [
            {'name': name, 'parameters': _parameters(partial.model, name, number)}
            for name, number in numbered
        ],
        'gap_closed': round(partial.closed, 4),
        'kind': partial.form.kind,
        'closed': round(partial.form.closed, 3),
        'terms': _terms(partial.form),
        'place': None if partial.spot is None else _spot(partial.spot),
    }


def _terms(form: RemainderForm) -> list[dict[str, Any]]:
    return [
        {
            'name': term.name,
            'kind': term.kind,
            'amount': term.amount,
            'unit': term.unit,
            'words': term.words,
            'check': term.check,
            'place': _place(term.place),
        }
        for term in form.terms
    ]


def _shared_errors(result: Diagnosis) -> dict[str, Any] | None:
    """Return the standard deviations of the errors that all maps share; None if unknown."""
    sizes = result.samples[0].shared_errors
    if sizes is None:
        return None
    return {
        'scale_by_sand': [round(scale, 4) for scale in sizes.scales],
        'bend': round(sizes.bend, 4),
        'place_m': round(sizes.place_m, 6),
        'blur_m2': round(sizes.blur_m2, 9),
    }


def _spot(spot: Spot) -> dict[str, float]:
    return {
        'x_m': round(spot.x, 4),
        'z_m': round(spot.z, 4),
        'radius_m': round(spot.radius, 4),
        'share': round(spot.share, 3),
    }


def _phase(phase: Phase, result: Diagnosis) -> dict[str, Any]:
    """Return a phase of the gap; of several recordings also the recording."""
    several = len(result.recordings) > 1
    return {
        'start_s': phase.start,
        'end_s': phase.end,
        'share': round(phase.share, 3),
        'state': phase.state,
        **({'recording': str(result.recordings[phase.recording].source)} if several else {}),
    }


def _proposal(proposal: Proposal) -> dict[str, Any]:
    return {
        'name': proposal.name,
        'what': proposal.description,
        'separates': list(proposal.separates),
        'gain': None if proposal.gain is None else round(proposal.gain, 2),
    }


def errors_of(parts: Sequence[HeldOut]) -> Errors:
    """Return the errors of all recordings together, and the share of the gap that closes."""
    closed, (low, high) = gap_closed_with_interval(parts)
    return Errors(
        noise_floor=round(root_mean_square([part.noise_floor for part in parts]), 5),
        before=round(root_mean_square([part.error_before for part in parts]), 5),
        after=round(root_mean_square([part.error_after for part in parts]), 5),
        gap_closed=round(closed, 4),
        gap_closed_low=round(low, 4),
        gap_closed_high=round(high, 4),
    )


def _by_recording(result: Diagnosis) -> list[dict[str, Any]]:
    """Return the errors of every recording by itself; the effects are the same in all."""
    return [
        {
            'recording': str(recording.source),
            'held_out': {'start_s': float(part.times[0]), 'end_s': sample.end},
            **errors_of([part])._asdict(),
        }
        for recording, sample, part in zip(
            result.recordings, result.samples, result.held_out, strict=True
        )
    ]


def _place(place: Place | None) -> dict[str, float] | None:
    return None if place is None else {'x_m': round(place[0], 4), 'z_m': round(place[1], 4)}


def _centre(result: Diagnosis) -> dict[str, float] | None:
    """Return the place of the named effect (a zone, a leak or a well); None if it has no place.

    For an unexplained gap it is the place of the strongest term of its form.
    """
    form = result.remainder
    if form is not None:
        return _place(form.terms[0].place) if form.terms else None
    for described in result.verdict.model.effects:
        if described.name != result.verdict.name:
            continue
        values = described.parameters
        if EFFECTS[described.name].has_place:
            return _place((float(values['x']), float(values['z'])))
        if 'well' in values:
            well = result.recordings[0].rig.wells[str(values['well'])]
            return {'x_m': well.x_m, 'z_m': well.z_m}
    return None


def _effects(result: Diagnosis) -> list[dict[str, Any]]:
    """Return a row for every effect that was tried, the most probable first."""
    verdict, errors = result.verdict, errors_of(result.held_out)
    best = _best_fits(result.evidence.findings)
    probabilities = stated_probabilities(verdict, list(best))
    rows: dict[tuple[str, int], dict[str, Any]] = {
        (name, 0): {
            'name': name,
            'probability': round(probabilities[name], 4),
            'parameters': _parameters(fit, name, 0),
            **_errors_alone(fit, errors, result.evidence.findings),
        }
        for name, fit in best.items()
    }
    for name, number in with_occurrences(verdict.members):
        alone = rows[name, 0] if name in best else {}
        rows[name, number] = alone | _member_row(name, number, result, errors)
    for name, fit in _fits_of_alternatives(result):
        if (name, 0) in rows:
            rows[name, 0]['parameters'] = _parameters(fit, name, 0)
    return sorted(
        rows.values(),
        key=lambda row: (
            -float(row['probability']),
            row['name'] != verdict.name,
            float(row['error_after']),
        ),
    )


def _fits_of_alternatives(result: Diagnosis) -> Iterator[tuple[str, Fit]]:
    """Yield the effects of the other combinations that look the same, each with its joint fit.

    Alone, such an effect would take other sizes.
    """
    verdict = result.verdict
    for names in verdict.alternatives:
        fit = _joint_fit(result.evidence.findings, names)
        if fit is not None:
            yield from ((name, fit) for name in names if name not in verdict.members)


def _joint_fit(findings: Findings, names: Sequence[str]) -> Fit | None:
    """Return the best judged fit of the effects `names` together; None if there is none."""
    fits = (*findings.pairs, *findings.triples)
    same = (f for f in fits if sorted(one.effect for one in f.members) == sorted(names))
    return next(same, None)


def _joint_rows(result: Diagnosis, names: Sequence[str]) -> list[dict[str, Any]]:
    """Return the effects `names` with the parameters of their joint fit; empty without one."""
    fit = _joint_fit(result.evidence.findings, names)
    if fit is None:
        return []
    return [
        {'name': name, 'parameters': _parameters(fit, name, number)}
        for name, number in with_occurrences(names)
    ]


def _best_fits(findings: Findings) -> dict[str, Fit]:
    """Return the best fit of every effect alone, by its name.

    The members of the best pair come last: one may have been found only together with the other.
    """
    best: dict[str, Fit] = {}
    for fit in (*findings.singles, *findings.screened, *findings.parts):
        best.setdefault(fit.members[0].effect, fit)
    return best


def _member_row(name: str, number: int, result: Diagnosis, errors: Errors) -> dict[str, Any]:
    """Return the entries of a named effect that replace the entries of its fit alone.

    `number` counts the members of the same name.
    """
    verdict, findings = result.verdict, result.evidence.findings
    if name == NUMERICAL:
        return _numerical_row(result, errors)
    row: dict[str, Any] = {}
    if len(verdict.model.members) > 1:  # the order of the members is decided by these fits
        parts = [part for part in findings.parts if part.members[0].effect == name]
        row = _errors_alone(parts[number], errors, findings) if number < len(parts) else {}
    row['parameters'] = _parameters(verdict.model, name, number)
    if len(verdict.model.members) == 1:
        row |= {'error_after': errors.after, 'gap_closed': errors.gap_closed}
    return row


def _numerical_row(result: Diagnosis, errors: Errors) -> dict[str, Any]:
    value = result.evidence.numerics.model_diffusion
    low, high = (factor * value for factor in MODEL_DIFFUSION_RANGE)
    return {
        'name': NUMERICAL,
        'probability': round(result.verdict.confidence, 4),
        'parameters': {
            'model_diffusion': {'value': value, 'low': low, 'high': high, 'unit': 'm2/s'}
        },
        'error_before': errors.before,
        'error_after': errors.after,
        'gap_closed': errors.gap_closed,
    }


def remaining_error(fit: Fit, errors: Errors, findings: Findings) -> float:
    """Return the relative L2 error of the held-out part with the effects of `fit`.

    The fit and the stated errors use different cells. So the error of the fit is scaled with the
    error of the model without effects on the same cells: after = before * e_fit / e_null. Maps on
    coarse screening cells contain less noise; their scaled error is at least the noise floor.
    """
    screened = any(fit is other for other in findings.screened)
    null = findings.screened_null if screened else findings.null
    after = errors.before * fit.held_out_error / max(null.held_out_error, 1e-9)
    return max(after, errors.noise_floor) if screened else after


def _errors_alone(fit: Fit, errors: Errors, findings: Findings) -> dict[str, float]:
    """Return the errors before and after adding one effect alone."""
    after = remaining_error(fit, errors, findings)
    return {
        'error_before': errors.before,
        'error_after': round(after, 5),
        'gap_closed': round(gap_closed(errors.before, after, errors.noise_floor), 4),
    }


def _parameters(fit: Fit, name: str, number: int) -> dict[str, Any]:
    """Return the parameters of a member with their 90 % intervals, where they are known.

    It is member `number` of those with the effect `name`.
    """
    mine = [one for one in fit.member_parameters if one.candidate.effect == name]
    member, scaled, deviations = occurrence(mine, number, name)
    found: dict[str, Any] = {}
    for key, value in member.fixed.items():
        found[key] = {'value': value}
        if not isinstance(value, str):
            unit = EFFECTS[name].parameters[key].unit
            found[key] |= {'low': None, 'high': None, 'unit': unit}
    for parameter, at, deviation in zip(member.parameters, scaled, deviations, strict=True):
        low, high = None, None
        if deviation > 0 and math.isfinite(deviation):
            low = parameter.value(float(at) - INTERVAL_DEVIATIONS * float(deviation))
            high = parameter.value(float(at) + INTERVAL_DEVIATIONS * float(deviation))
        found[parameter.name] = {
            'value': parameter.value(float(at)),
            'low': low,
            'high': high,
            'unit': parameter.unit,
        }
    return found
