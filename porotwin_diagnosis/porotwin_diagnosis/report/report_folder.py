"""The folder of a report: checked before a diagnosis, written after it.

folder = checked_folder('monday-diagnosis', ['runs/monday'])
summary = write_diagnosis(examine(recordings), folder)
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from porotwin_core.errors import InputError
from porotwin_core.rig import Rig, write_rig
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.progress import Progress, no_progress
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.evidence_json import write_evidence
from porotwin_diagnosis.report.held_out_fields import write_fields
from porotwin_diagnosis.report.page import write_report

REPORT = 'report.html'
"""Name of the page; it is written last, so that a folder with a page is complete."""


def checked_folder(output: Path | str, recordings: Sequence[Path | str]) -> Path:
    """Return the folder `output`, which is made if it does not exist.

    Raises:
        InputError: it cannot be made or written, or it is one of the `recordings`, whose files
            would be replaced.
    """
    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f'{folder}: {error.strerror}; name another folder for the report'
        ) from error
    if not os.access(folder, os.W_OK):
        raise InputError(f'{folder}: cannot be written; name another folder for the report')
    if folder.resolve() in {Path(recording).resolve() for recording in recordings}:
        raise InputError(f'{folder}: is the recording; name another folder for the report')
    return folder


def write_diagnosis(
    result: Diagnosis,
    folder: Path,
    *,
    apply: bool = False,
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Write the report on `result` and all files beside it; return the content of diagnosis.json.

    Files: `diagnosis.json`, `fields.nc` (and `fields_2.nc`, ... of further recordings),
    `findings.json`, `report.html`. With `apply` also `rig.yaml`: the rig description with the
    effects that were found.
    """
    progress('writing the report', 0.98)
    summary = diagnosis_json(result)
    (folder / 'diagnosis.json').write_text(
        json.dumps(summary, indent=2, allow_nan=False) + '\n', encoding='utf-8'
    )
    parts = zip(result.recordings, result.gap.each, result.held_out, strict=True)
    for number, (recording, strength, part) in enumerate(parts, 1):
        name = 'fields.nc' if number == 1 else f'fields_{number}.nc'
        write_fields(folder / name, recording.grid, strength, part)
    write_evidence(folder / 'findings.json', result.evidence)
    if apply:
        write_rig(rig_with_effects(result.recordings[0].rig, result.verdict), folder / 'rig.yaml')
    write_report(folder / REPORT, result, summary)
    progress('done', 1.0)
    return summary


def rig_with_effects(rig: Rig, verdict: Verdict) -> Rig:
    """Return `rig` with the effects that `verdict` names; unchanged if it names none."""
    if not verdict.members:
        return rig
    return rig.with_effects(verdict.model.effects)
