"""A diagnosis as files for programs: diagnosis.json and fields.nc (diagnosis contract)."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4

from porotwin_core.grid import FloatArray, Grid
from porotwin_diagnosis.decision.held_out import HeldOut, gap_closed, root_mean, together
from porotwin_diagnosis.decision.verdict import NONE, NUMERICAL, UNEXPLAINED, Verdict
from porotwin_diagnosis.model.candidate import LOCAL
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.model.gap_map import Phase, Spot
from porotwin_diagnosis.search.findings import Findings
from porotwin_diagnosis.search.ranking import overall_misfit, score

if TYPE_CHECKING:
    from porotwin_diagnosis.examine import Diagnosis

FIXED_UNITS = {
    'diffusion': 'm2/s',
    'longitudinal_dispersivity': 'm',
    'transverse_dispersivity': 'm',
}
"""Units of parameters that a candidate may hold fixed."""

INTERVAL = 1.645 * 1.7
"""Standard deviations of a 90 % interval, widened: what the scheme does wrong shifts parameters as
well, and with tiles alone the intervals held only two thirds of the truths of another simulator."""


def diagnosis_json(result: 'Diagnosis') -> dict[str, Any]:
    """Return the content of diagnosis.json."""
    verdict, held_out = result.verdict, result.held_out
    kept = verdict.name not in (NONE, UNEXPLAINED)
    sample = result.samples[0]
    return {
        'schema': 1,
        'verdict': verdict.name,
        'confidence': round(verdict.confidence, 3),
        'not_separable_from': list(verdict.inseparable),
        'combination': list(verdict.members) if kept else [],
        'combination_alternatives': [list(names) for names in verdict.alternatives],
        'effects': _effects(result),
        'error': _errors(held_out),
        'where': {
            'centre': _centre(result),
            'hot_spots': [_spot(spot) for spot in result.gap.spots],
        },
        'when': [_phase(phase, result) for phase in result.gap.phases],
        'held_out': {'start_s': float(result.held_out[0].times[0]), 'end_s': sample.end},
        'misfit': {
            'before': round(score(result.findings.null), 3),
            'after': round(score(verdict.model), 3),
            'noise': round(overall_misfit(*verdict.model.noise_misfit), 3),
            'unit': 'deviations at fronts, of noise and of 0.12 cells',
        },
        'noise': {
            'grain': round(sample.noise.grain, 4),
            'frame': round(sample.noise.frame, 4),
            'background': round(sample.noise.background, 4),
            'correlation_cells': round(sample.noise.correlation, 2),
            'blur_cells': round(held_out[0].blur, 2),
        },
        'smallest_visible': result.strengths,
        'next_experiment': [
            {
                'name': proposal.name,
                'what': proposal.what,
                'separates': list(proposal.separates),
                'gain': None if proposal.gain is None else round(proposal.gain, 2),
            }
            for proposal in result.proposals
        ],
        'recordings': [str(recording.source) for recording in result.recordings],
        'by_recording': _by_recording(result),
    }


def _spot(spot: Spot) -> dict[str, float]:
    return {
        'x_m': round(spot.x, 4),
        'z_m': round(spot.z, 4),
        'radius_m': round(spot.radius, 4),
        'share': round(spot.share, 3),
    }


def _phase(phase: Phase, result: 'Diagnosis') -> dict[str, Any]:
    """Return a time at which the gap arises; of several recordings it says in which."""
    which = {}
    if len(result.recordings) > 1:
        which['recording'] = str(result.recordings[phase.recording].source)
    return {
        'start_s': phase.start,
        'end_s': phase.end,
        'share': round(phase.share, 3),
        'state': phase.state,
        **which,
    }


def _errors(parts: Sequence[HeldOut]) -> dict[str, float]:
    """Return the errors of all recordings together, and how much of the gap closes."""
    closed, (low, high) = together(parts)
    return {
        'noise_floor': round(root_mean([part.noise_floor for part in parts]), 5),
        'before': round(root_mean([part.error_before for part in parts]), 5),
        'after': round(root_mean([part.error_after for part in parts]), 5),
        'gap_closed': round(closed, 4),
        'gap_closed_low': round(low, 4),
        'gap_closed_high': round(high, 4),
    }


def _by_recording(result: 'Diagnosis') -> list[dict[str, Any]]:
    """Return what every recording says by itself, with the effects that all have in common."""
    return [
        {
            'recording': str(recording.source),
            'held_out': {'start_s': float(part.times[0]), 'end_s': sample.end},
            **_errors([part]),
        }
        for recording, sample, part in zip(
            result.recordings, result.samples, result.held_out, strict=True
        )
    ]


def _centre(result: 'Diagnosis') -> dict[str, float] | None:
    """Return the place of the verdict's effect: that of the zone, the leak or the well."""
    for described in result.verdict.model.effects:
        if described.name != result.verdict.name:
            continue
        values = described.parameters
        if described.name in LOCAL:
            return {'x_m': round(float(values['x']), 4), 'z_m': round(float(values['z']), 4)}
        if 'well' in values:
            well = result.recordings[0].rig.wells[str(values['well'])]
            return {'x_m': well.x_m, 'z_m': well.z_m}
    return None


def _effects(result: 'Diagnosis') -> list[dict[str, Any]]:
    """Return all candidates that were tried, the most probable first."""
    verdict = result.verdict
    errors = _errors(result.held_out)
    best: dict[str, Fit] = {}
    for fit in [*result.findings.singles, *result.findings.screened]:
        best.setdefault(fit.members[0].effect, fit)
    for fit in result.findings.parts:  # a partner may have been found beside another only
        best.setdefault(fit.members[0].effect, fit)
    shares = _probabilities(verdict, list(best))
    rows: dict[str, dict[str, Any]] = {}
    for name, fit in best.items():
        rows[name] = {
            'name': name,
            'probability': round(shares[name], 4),
            'parameters': _parameters(fit, name),
            **_alone(fit, errors, result.findings),
        }
    for name in verdict.members:
        if name == NUMERICAL:
            rows[name] = _numerical_row(result, errors)
            continue
        for part in result.findings.parts:  # by these the members are put in order
            if part.members[0].effect == name and len(verdict.model.members) > 1:
                rows[name] |= _alone(part, errors, result.findings)
        rows[name]['parameters'] = _parameters(verdict.model, name)
        if len(verdict.model.members) == 1:
            rows[name] |= {'error_after': errors['after'], 'gap_closed': errors['gap_closed']}
    return sorted(
        rows.values(),
        key=lambda row: (
            -float(row['probability']),
            row['name'] != verdict.name,
            float(row['error_after']),
        ),
    )


def _probabilities(verdict: Verdict, names: Sequence[str]) -> dict[str, float]:
    """Return the probability of every effect, which agree with the verdict's confidence.

    The verdict and what shows the same share it; a partner is as sure as the pair. What the
    confidence leaves is for all others together, also where none of them is the verdict, and for
    what the library lacks.
    """
    raw = {name: verdict.probabilities.get(name, 0.0) for name in names}
    alike = [name for name in (verdict.name, *verdict.inseparable) if name in raw]
    size = sum(raw[name] for name in alike)
    found = {
        name: verdict.confidence * (raw[name] / size if size > 0 else 1 / len(alike))
        for name in alike
    }
    found |= {
        name: verdict.confidence for name in verdict.members if name in raw and name not in found
    }
    others = [name for name in names if name not in found]
    left = (1.0 - verdict.confidence) / max(sum(raw[name] for name in others), 1e-12)
    return found | {name: raw[name] * min(left, 1.0) for name in others}


def _numerical_row(result: 'Diagnosis', errors: dict[str, float]) -> dict[str, Any]:
    value = result.numerics.model_diffusion
    return {
        'name': NUMERICAL,
        'probability': round(result.verdict.confidence, 4),
        'parameters': {
            'model_diffusion': {
                'value': value,
                'low': 0.5 * value,
                'high': 2.0 * value,
                'unit': 'm2/s',
            }
        },
        'error_before': errors['before'],
        'error_after': errors['after'],
        'gap_closed': errors['gap_closed'],
    }


def error_left(fit: Fit, errors: Mapping[str, float], findings: Findings) -> float:
    """Return the held-out error that `fit` leaves, at the level it has reached relative to the
    model without any effect, whose error is `errors['before']`."""
    screened = any(fit is other for other in findings.screened)
    null = findings.screened_null if screened else findings.null
    after = errors['before'] * fit.held_out_error / max(null.held_out_error, 1e-9)
    # coarse cells have less noise; no fit on the recording's comes below its floor
    return max(after, errors['noise_floor']) if screened else after


def _alone(fit: Fit, errors: dict[str, float], findings: Findings) -> dict[str, float]:
    """Return the errors of one effect alone."""
    before, floor = errors['before'], errors['noise_floor']
    after = error_left(fit, errors, findings)
    return {
        'error_before': before,
        'error_after': round(after, 5),
        'gap_closed': round(gap_closed(before, after, floor), 4),
    }


def _parameters(fit: Fit, name: str) -> dict[str, Any]:
    """Return the parameters of member `name` with their 90 % intervals; without, where unknown."""
    for member, scaled, deviations in fit.member_parameters:
        if member.effect != name:
            continue
        found: dict[str, Any] = {}
        for key, value in member.fixed.items():
            found[key] = {'value': value}
            if not isinstance(value, str):
                found[key] |= {'low': None, 'high': None, 'unit': FIXED_UNITS[key]}
        for parameter, at, deviation in zip(member.parameters, scaled, deviations, strict=True):
            low, high = None, None
            if deviation > 0 and math.isfinite(deviation):
                low = parameter.value(float(at) - INTERVAL * float(deviation))
                high = parameter.value(float(at) + INTERVAL * float(deviation))
            found[parameter.name] = {
                'value': parameter.value(float(at)),
                'low': low,
                'high': high,
                'unit': parameter.unit,
            }
        return found
    return {}


def write_fields(path: Path, grid: Grid, gap: FloatArray, held_out: HeldOut) -> None:
    """Write the maps behind the verdict: gap (z, x); observed and predicted (time, z, x).

    `remainder` (z, x) is the root mean square over the held-out times of what the model leaves.
    """
    with netCDF4.Dataset(path, 'w') as dataset:
        axes = {'time': held_out.times, 'z': grid.z, 'x': grid.x}
        for name, values in axes.items():
            dataset.createDimension(name, len(values))
            dataset.createVariable(name, 'f8', (name,))[:] = values
            dataset[name].units = 's' if name == 'time' else 'm'
        maps = {
            'gap': gap,
            'remainder': held_out.remainder,
            'observed': held_out.observed,
            'predicted_before': held_out.before,
            'predicted_after': held_out.after,
        }
        for name, values in maps.items():
            shape = ('time', 'z', 'x')[3 - values.ndim :]
            dataset.createVariable(name, 'f4', shape, zlib=True)[:] = values
            dataset[name].units = '1/s' if name == 'gap' else '1'
