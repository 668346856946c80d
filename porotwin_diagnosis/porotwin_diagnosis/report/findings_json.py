"""The findings of a search as JSON: what was tried, and all that a verdict is decided from.

With these files a verdict can be decided again under other thresholds without simulating again,
which is how confidence is calibrated (`calibration`).
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from porotwin_diagnosis.model.candidate import Candidate
from porotwin_diagnosis.model.fit import Fit
from porotwin_diagnosis.search.findings import Findings


def write_findings(path: Path, findings: Findings) -> None:
    """Write `findings`; parameters that a fit found are in the units of the diagnosis contract."""
    content = {
        'runs': findings.runs,
        'null': _fit_json(findings.null),
        'screened_null': _fit_json(findings.screened_null),
        'screened': [_fit_json(fit) for fit in findings.screened],
        'singles': [_fit_json(fit) for fit in findings.singles],
        'pairs': [_fit_json(fit) for fit in findings.pairs],
        'parts': [_fit_json(fit) for fit in findings.parts],
        'part_changes': findings.part_changes,
        'distances': findings.distances,
        'pair_distances': findings.pair_distances,
    }
    path.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')


def read_findings(path: Path) -> Findings:
    """Return findings that were written: enough to decide, not to go on fitting."""
    content = json.loads(path.read_text(encoding='utf-8'))

    def fits(name: str) -> list[Fit]:
        return [_read_fit(fit) for fit in content[name]]

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
        'scaled': [float(scaled) for scaled in fit.scaled_parameters],
        'misfit': {
            'fitted': fit.fitted_misfit,
            'held_out': fit.held_out_misfit,
            'noise': list(fit.noise_misfit),
            'fingering_amplification': list(fit.fingering_amplification),
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
        fingering_amplification=tuple(content['misfit']['fingering_amplification']),
    )
