"""The origin of a diagnosis, so that a later call sees whether its report still holds."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from porotwin_core.basis.errors import InputError
from porotwin_core.rig import Rig
from porotwin_core.rig.rig_file import read_rig
from porotwin_recording.experiment.experiment_folder import FILES, RIG_FILE, is_experiment
from porotwin_recording.experiment.recording import Recording, open_recording
from porotwin_recording.mcap.bag_folder import bag_folder

MARK_LENGTH = 16
"""Hexadecimal digits of a mark."""


def origin_of(recording: Recording) -> dict[str, Any]:
    """Return place, rig and files of `recording` as diagnosis.json states them.

    The files are None if they are gone. Then no later call finds the report up to date.
    """
    try:
        files = files_mark(recording.source)
    except (InputError, OSError):
        files = None
    return {
        'recording': str(place_of(recording.source)),
        'rig': rig_mark(recording.rig),
        'files': files,
    }


def place_of(recording: Path | str) -> Path:
    """Return the resolved path of a recording; its rig.yaml means its folder."""
    path = Path(recording).resolve()
    return path.parent if path.name == RIG_FILE else path


def rig_mark(rig: Rig) -> str:
    """Return a short hash of all that a diagnosis reads of `rig`: everything but the control."""
    return mark_of(
        json.dumps(
            [rig.physics_fingerprint, rig.model_dump(mode='json', exclude={'control'})],
            sort_keys=True,
        )
    )


def files_mark(recording: Path | str) -> str:
    """Return a short hash of names, sizes and times of change of the files of a recording.

    It covers bags, rates, maps and the table of photographs. `rig_mark` covers the rig.

    Raises:
        InputError: there is no recording.
        OSError: a file cannot be looked at.
    """
    stats = [(file.name, file.stat()) for file in _files(place_of(recording))]
    return mark_of(json.dumps([[name, stat.st_size, stat.st_mtime_ns] for name, stat in stats]))


def check_unchanged(marks: Mapping[Path, str]) -> None:
    """Refuse a result if a recording has another `files_mark` than before, in `marks`.

    Raises:
        InputError: one has changed or is gone.
    """
    for recording, mark in marks.items():
        if files_mark(recording) != mark:
            raise InputError(
                f'{recording}: changed during its diagnosis; repeat the call when it is complete'
            )


def own_rig(recording: Path | str) -> Rig:
    """Return the rig that the recording itself describes, without a warning about odd values.

    Raises:
        InputError: as `open_recording`.
    """
    place = place_of(recording)
    if (place / RIG_FILE).is_file():
        return read_rig(place).rig
    return open_recording(place).rig


def mark_of(text: str) -> str:
    """Return a short hash of `text`."""
    return hashlib.sha256(text.encode()).hexdigest()[:MARK_LENGTH]


def _files(place: Path) -> list[Path]:
    if not place.exists():
        raise InputError(f'{place}: no such recording; name an experiment folder or an MCAP bag')
    if not is_experiment(place):
        return bag_folder(place).files
    read = [place / name for name in FILES if name != RIG_FILE]
    return [file for file in read if file.is_file()]
