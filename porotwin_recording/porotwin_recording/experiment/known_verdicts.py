"""The verdicts of diagnoses below a folder, by the recordings that they are about."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from porotwin_core.basis.json_text import json_value
from porotwin_core.basis.regular_file import read_regular
from porotwin_recording.experiment.experiment_folder import RIG_FILE

DIAGNOSES = 'diagnoses'
"""Folder beside the bag of a running twin with the diagnoses that the twin made itself."""

DIAGNOSIS_FILE = 'diagnosis.json'


class _Verdict(NamedTuple):
    """A verdict in words, and when its file was written [s]."""

    written: float
    words: str


class KnownVerdicts:
    """The newest verdict on each recording, from all `diagnosis.json` below some folders."""

    def __init__(self, *folders: Path) -> None:
        """Read the diagnoses below `folders`; a file that is no diagnosis counts as none."""
        self._newest: dict[Path, _Verdict] = {}
        for file in {found for folder in folders for found in folder.rglob(DIAGNOSIS_FILE)}:
            self._add(file)

    def of(self, recording: Path) -> str:
        """Return the newest verdict on `recording` with its confidence; empty: there is none."""
        found = self._newest.get(recording.resolve())
        return found.words if found else ''

    def _add(self, file: Path) -> None:
        try:
            content = json_value(read_regular(file))
            words = f'{content["verdict"]} ({100 * float(content["confidence"]):.0f} %)'
            if content.get('untried'):
                words = f'preliminary: {words}'
            recordings = [*_recordings(content), *_owners(file)]
            verdict = _Verdict(file.stat().st_mtime, words)
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            return
        for recording in recordings:
            self._newest[recording] = max(self._newest.get(recording, verdict), verdict)


def _recordings(content: Mapping[str, Any]) -> list[Path]:
    """Return the recordings that a diagnosis names."""
    return [Path(part['recording']).resolve() for part in content.get('by_recording', [])]


def _owners(file: Path) -> list[Path]:
    """Return the recordings that have the diagnosis `file` in a folder of theirs, or beside them.

    The diagnoses of a running twin name a copy of the run, so that their place tells the bag.
    """
    owner = file.resolve().parents[1]
    if owner.name != DIAGNOSES:
        return [owner]
    beside = owner.parent.iterdir()
    return [owner, *(path for path in beside if not (path / RIG_FILE).is_file())]
