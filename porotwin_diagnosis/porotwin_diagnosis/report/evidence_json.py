"""findings.json: all evidence of a verdict, so that it can be decided again.

With this file other thresholds can be tried without a simulation.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import write_whole
from porotwin_diagnosis.decision.evidence import Evidence
from porotwin_diagnosis.decision.explanation import explain
from porotwin_diagnosis.decision.numerics import Numerics
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings
from porotwin_solver.effects.definition.candidate import Candidate


def write_evidence(path: Path, evidence: Evidence) -> None:
    """Write `evidence`; fitted parameters are in the units of the diagnosis contract."""
    findings = evidence.findings
    content = {
        'runs': findings.runs,
        'null': _fit_json(findings.null),
        'screened_null': _fit_json(findings.screened_null),
        'screened': [_fit_json(fit) for fit in findings.screened],
        'singles': [_fit_json(fit) for fit in findings.singles],
        'pairs': [_fit_json(fit) for fit in findings.pairs],
        'triples': [_fit_json(fit) for fit in findings.triples],
        'parts': [_fit_json(fit) for fit in findings.parts],
        'part_changes': findings.part_changes,
        'distances': findings.distances,
        'pair_distances': findings.pair_distances,
        'numerics': asdict(evidence.numerics),
        'cells_along': evidence.cells_along,
        'fitted_frames': evidence.fitted_frames,
        'may_have_held_tracer': evidence.may_have_held_tracer,
    }
    write_whole(path, json.dumps(content, indent=1) + '\n')


def read_evidence(path: Path) -> Evidence:
    """Return the evidence in the file `path`: enough for a new decision, not for new fits.

    The explanation is computed again from the fits.
    """
    content = json_value(read_regular(path))
    findings = _read_findings(content)
    return Evidence(
        findings,
        explain(findings),
        Numerics(**content['numerics']),
        cells_along=content['cells_along'],
        fitted_frames=content['fitted_frames'],
        may_have_held_tracer=content.get('may_have_held_tracer', False),
    )


def _read_findings(content: dict[str, Any]) -> Findings:
    def fits(name: str) -> list[Fit]:
        return [_read_fit(fit) for fit in content.get(name, ())]

    return Findings(
        null=_read_fit(content['null']),
        screened_null=_read_fit(content['screened_null']),
        screened=fits('screened'),
        singles=fits('singles'),
        pairs=fits('pairs'),
        parts=fits('parts'),
        part_changes=content['part_changes'],
        distances=content['distances'],
        pair_distances=content['pair_distances'],
        runs=content['runs'],
        triples=fits('triples'),
    )


def _fit_json(fit: Fit) -> dict[str, Any]:
    return {
        'members': [
            {
                'effect': member.effect,
                'variant': member.variant,
                'fixed': member.fixed,
                'parameters': described.parameters,
            }
            for member, described in zip(fit.members, fit.effects, strict=True)
        ],
        'described': list(fit.described),
        'scaled': [float(scaled) for scaled in fit.scaled_parameters],
        'misfit': {
            'fitted': fit.fitted_misfit,
            'held_out': fit.held_out_misfit,
            'noise': list(fit.noise_misfit),
            'expected_noise': list(fit.expected_noise),
            'unshared': list(fit.unshared_misfit),
        },
        'error': {'fitted': fit.fitted_error, 'held_out': fit.held_out_error},
    }


def _read_fit(content: dict[str, Any]) -> Fit:
    scaled: Sequence[float] = content['scaled']
    return Fit(
        members=tuple(
            Candidate(member['effect'], (), member['fixed'], (), member['variant'])
            for member in content['members']
        ),
        scaled_parameters=np.array(scaled, dtype=float),
        fitted_misfit=content['misfit']['fitted'],
        held_out_misfit=content['misfit']['held_out'],
        fitted_error=content['error']['fitted'],
        held_out_error=content['error']['held_out'],
        covariance=np.zeros((len(scaled), len(scaled))),
        noise_misfit=tuple(content['misfit']['noise']),
        expected_noise=tuple(content['misfit'].get('expected_noise', content['misfit']['noise'])),
        unshared_misfit=tuple(content['misfit'].get('unshared', (0.0, 0.0))),
        described=tuple(content.get('described', ())),
    )
