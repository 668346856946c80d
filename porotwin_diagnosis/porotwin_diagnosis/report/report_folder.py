"""The folder of a report: checked before a diagnosis, written after it.

folder = checked_folder('monday-diagnosis', ['runs/monday'])
summary = write_diagnosis(examine(recordings), folder)
"""

import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.basis.json_text import plain_json
from porotwin_core.basis.photo_list import IMAGING_FILE
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.whole_file import whole_file, write_whole
from porotwin_core.model.effect_parameter import lasting
from porotwin_core.rig import Rig, write_rig
from porotwin_core.rig.yaml_reader import read_yaml
from porotwin_diagnosis.decision.verdict import Verdict
from porotwin_diagnosis.diagnosis import Diagnosis
from porotwin_diagnosis.progress import Progress, no_progress
from porotwin_diagnosis.report.diagnosis_json import diagnosis_json
from porotwin_diagnosis.report.evidence_json import write_evidence
from porotwin_diagnosis.report.held_out_fields import write_fields
from porotwin_diagnosis.report.origin import mark_of
from porotwin_diagnosis.report.page import write_report
from porotwin_recording.experiment.experiment_folder import COMMANDED_FILE, MAPS_FILE, RIG_FILE
from porotwin_recording.mcap.bag_folder import METADATA, mcap_files

REPORT = 'report.html'
"""Name of the page; it is written last, so that a folder with a page is complete."""

SUMMARY, FINDINGS = 'diagnosis.json', 'findings.json'
"""Names of further files of a report."""

APPLIED = (
    '# Written by ./porotwin diagnose --apply. Later diagnoses here replace it unless edited: '
)
"""First line of the rig.yaml of a diagnosis; a hash of all further lines follows."""


def checked_folder(output: Path | str, recordings: Sequence[Path | str]) -> Path:
    """Return the folder `output`, which is made if it does not exist.

    Args:
        output: the folder.
        recordings: recordings and rig.yaml files that the diagnosis reads.

    Raises:
        InputError: it cannot be made or written, it holds one of the `recordings` or another one,
            or it holds a rig.yaml that no diagnosis wrote.
    """
    folder = Path(output)
    check_apart(folder, recordings)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f'{folder}: {error.strerror}; name another folder for the report'
        ) from error
    if not os.access(folder, os.W_OK):
        raise InputError(f'{folder}: cannot be written; name another folder for the report')
    if (folder / METADATA).is_file() or mcap_files(folder):
        raise InputError(f'{folder}: holds a bag; name another folder for the report')
    for name in (COMMANDED_FILE, MAPS_FILE, IMAGING_FILE):
        if (folder / name).exists():
            raise InputError(
                f'{folder}: holds {name} of a recording; name another folder for the report'
            )
    _check_own_files(folder)
    if os.path.lexists(folder / RIG_FILE) and not _is_own(folder / RIG_FILE):
        raise InputError(
            f'{folder}: holds a {RIG_FILE} that no diagnosis wrote, or that was edited since; name '
            'another folder for the report, or move that file'
        )
    return folder


def _check_own_files(folder: Path) -> None:
    """Check that no file of a report in `folder` was written by somebody else."""
    found = sorted(filter(lambda path: _is_of_report(path.name), folder.iterdir()))
    for path in found:
        if path.is_dir():
            raise InputError(f'{path}: is a folder; name another folder for the report, or move it')
    if (folder / SUMMARY).is_file():
        return
    for path in found:  # diagnosis.json is written before them
        if path.name != RIG_FILE:
            raise InputError(
                f'{folder}: holds {path.name}, but no {SUMMARY}, so that no diagnosis wrote it; '
                'name another folder for the report, or move that file'
            )


def check_apart(folder: Path, recordings: Sequence[Path | str]) -> None:
    """Check that a diagnosis in `folder` writes no file beside a recording.

    Raises:
        InputError: `folder` is one of the `recordings`, or holds one of them that is a file.
    """
    place = folder.resolve()
    for recording in map(Path, recordings):
        if recording.resolve() == place:
            raise InputError(f'{folder}: is the recording; name another folder for the report')
        if recording.is_file() and place in (
            recording.parent.resolve(),
            recording.resolve().parent,
        ):
            raise InputError(
                f'{folder}: holds {recording.name}, which is read; name another folder for the '
                'report'
            )


def write_diagnosis(
    result: Diagnosis,
    folder: Path,
    *,
    apply: bool = False,
    compare: Callable[[Mapping[str, Any]], list[str]] = lambda _summary: [],
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Write the report on `result` and all files beside it; return the content of diagnosis.json.

    Files: `diagnosis.json`, `fields.nc` (and `fields_2.nc`, ... of further recordings),
    `findings.json`, `report.html`. With `apply` also `rig.yaml`: the rig description with the
    effects that were found. Page, fields and rig.yaml of an earlier diagnosis are removed first.
    `compare` returns lines on how the finding fits to earlier ones; they become `history`.
    """
    progress('writing the report', 0.98)
    summary = diagnosis_json(result)
    summary['history'] += compare(summary)
    (folder / REPORT).unlink(missing_ok=True)
    _remove_own_rig(folder)
    for path in list(folder.iterdir()):
        if _is_of_fields(path.name):  # there may have been more recordings
            path.unlink()
    write_whole(folder / SUMMARY, json.dumps(plain_json(summary), indent=2) + '\n')
    parts = zip(result.recordings, result.gap.each, result.held_out, strict=True)
    for number, (recording, strength, part) in enumerate(parts, 1):
        name = 'fields.nc' if number == 1 else f'fields_{number}.nc'
        write_fields(folder / name, recording.grid, strength, part)
    write_evidence(folder / FINDINGS, result.evidence)
    if apply:
        _write_own_rig(rig_with_effects(result.recordings[0].rig, result.verdict), folder)
    write_report(folder / REPORT, result, summary)
    progress('done', 1.0)
    return summary


def rig_with_effects(rig: Rig, verdict: Verdict) -> Rig:
    """Return `rig` with the effects that `verdict` names, as they last; unchanged without any."""
    if not verdict.members:
        return rig
    return rig.with_effects(map(lasting, verdict.model.effects))


def _write_own_rig(rig: Rig, folder: Path) -> None:
    """Write `rig` with a first line that says who wrote it; replace no file in `folder`."""

    def is_taken(name: str) -> bool:
        return _is_of_report(name) or os.path.lexists(folder / name)

    with whole_file(folder / RIG_FILE) as begun:
        write_rig(rig, begun, is_taken=is_taken)
        text = begun.read_text(encoding='utf-8')
        begun.write_text(f'{APPLIED}{mark_of(text)}\n{text}', encoding='utf-8')


def _is_of_report(name: str) -> bool:
    return name in (SUMMARY, FINDINGS, REPORT, RIG_FILE) or _is_of_fields(name)


def _is_of_fields(name: str) -> bool:
    return re.fullmatch(r'fields(_\d+)?\.nc', name) is not None


def _is_own(path: Path) -> bool:
    """Return whether a diagnosis wrote the rig.yaml at `path`, and nobody has edited it."""
    try:
        first, _, text = read_regular(path).decode().partition('\n')
    except (OSError, ValueError):
        return False
    return first == f'{APPLIED}{mark_of(text)}' and (path.parent / SUMMARY).is_file()


def _remove_own_rig(folder: Path) -> None:
    """Remove the rig.yaml that an earlier diagnosis wrote in `folder`, with the files it names."""
    path = folder / RIG_FILE
    if not _is_own(path):
        return
    names = _named_files(read_yaml(read_regular(path).decode()))
    path.unlink()
    for name in names:
        (folder / name).unlink(missing_ok=True)


def _named_files(data: Any) -> list[str]:
    """Return the names of all files in `data`, the content of a rig.yaml by `write_rig`."""
    if not isinstance(data, dict):
        return []
    found = [name for value in data.values() for name in _named_files(value)]
    return [*found, data['file']] if isinstance(data.get('file'), str) else found
